// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/stages/banded_sgm.h"
#include "host/stages/census.h"
#include "host/stages/step_penalties.h"

namespace egosgm {

/// Semi-global matching from grey values to disparities, with what lies between: codes and penalties.
class Matcher {
 public:
  /// Sizes that suit a device (egosgm/tuning.h).
  struct Sizes {
    std::optional<BandedSgmPaths::Group> group;
    BandedSgm::Tile tile;
  };

  Matcher(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, const BandedSgmOptions& options,
          const Sizes& sizes = {});

  /// Builds what images of `type` need.
  void prepare(PixelType type);

  /// See BandedSgm.
  void prepare_reading_off() { banded_sgm_.prepare_reading_off(); }

  /// See BandedSgm. `coded`: rows that get codes, those that are matched among them. REQUIRES: the images' type was
  /// prepared.
  void match(const FrameImages& images, const SearchBands& bands, StereoMaps& matched, Views views, cl_int coded = 1);
  void reading_off(const FrameImages& images, const SearchBands& bands, StereoMaps& matched, Views views, cl_int coded);

  const BandedSgm& banded_sgm() const { return banded_sgm_; }
  const ocl::Buffer<cl_uint>& codes() const { return codes_; }
  const ocl::Buffer<cl_uchar>& penalties() const { return penalties_; }

 private:
  MatchInputs inputs(const FrameImages& images, const SearchBands& bands, Views views, cl_int coded);

  OfEachType<Census> census_;
  OfEachType<StepPenalties> step_penalties_;
  BandedSgm banded_sgm_;
  ocl::Buffer<cl_uint> codes_;
  ocl::Buffer<cl_uchar> penalties_;
};

}  // namespace egosgm
