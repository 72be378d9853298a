// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "egosgm/options.h"
#include "host/banded_sgm.h"
#include "host/census.h"
#include "host/consistency_check.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"
#include "host/search_band.h"
#include "host/step_penalties.h"

namespace egosgm {

/// Matches both views over the full range at a quarter of the resolution, without a prediction: what is far from what
/// the prediction says shows here first. A pixel of the result stands for EGOSGM_COARSE x EGOSGM_COARSE pixels, and its
/// disparity for EGOSGM_COARSE times as many.
class CoarseMatch {
 public:
  CoarseMatch(ocl::Context& context, shared::ImageSize size, const PipelineOptions& options);

  /// Left-right consistent disparities of both views, `coarse_size` of the images' each.
  const StereoMaps& operator()(const FrameImages& images);

  /// Cells that a call matches, of both views.
  std::uint64_t matched_cells() const;

  /// What the last call returned.
  const StereoMaps& found() const { return checked_; }

  static shared::ImageSize coarse_size(shared::ImageSize size);
  static shared::DisparityRange coarse_range(shared::DisparityRange range);
  /// The options of BandedSgm at that resolution.
  static BandedSgmOptions matcher(const PipelineOptions& options);

 private:
  using Shrink = ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>>;

  ocl::Context& context_;
  const shared::ImageSize size_, coarse_;
  const shared::DisparityRange range_;
  const BandedSgmOptions matcher_;
  const float max_difference_px_;
  Shrink shrink_u8_, shrink_u16_;
  SearchBand band_;
  Census census_;
  StepPenalties step_penalties_;
  BandedSgm banded_sgm_;
  ConsistencyCheck consistency_;
  ocl::Buffer<cl_uchar> images_;
  ocl::Buffer<cl_uint> codes_;
  ocl::Buffer<cl_uchar> penalties_;
  StereoMaps matched_, checked_;
};

}  // namespace egosgm
