// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method/predict_step.h"
#include "host/stages/coarse_match.h"
#include "host/stages/search_band.h"

namespace egosgm {

/// Says where each pixel is searched.
class SearchStep {
 public:
  SearchStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options, const Tuning& tuning);

  /// Builds what images of `type` need.
  void prepare(PixelType type);

  /// Writes `coarse`, what CoarseMatch finds in the images, where the plan has one. The prediction is read where the
  /// plan predicts.
  void plan_bands(const Plan& plan, const FrameImages& images, const Prediction& prediction, Map& coarse,
                  SearchBands& bands);

  /// REQUIRES: the last frame had a coarse match.
  const ocl::Buffer<cl_uchar>& coarse_images() const { return coarse_match_->images(); }

  /// Cells that a coarse match matches.
  std::uint64_t coarse_cells() const { return coarse_match_ ? coarse_match_->matched_cells() : 0; }

 private:
  std::optional<CoarseMatch> coarse_match_;
  SearchBand search_band_;
};

}  // namespace egosgm
