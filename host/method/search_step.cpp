// SPDX-License-Identifier: Apache-2.0
#include "host/method/search_step.h"

namespace egosgm {

SearchStep::SearchStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options,
                       const Tuning& tuning)
    : search_band_(context, size, range_of(options), options.search_band, tuning.row_group) {
  if (options.coarse_match.enabled && may_fuse(options) && options.search == SearchMode::kBand) {
    coarse_match_.emplace(context, size, options,
                          BandedSgm::Tile{tuning.tile_width, tuning.tile_height, tuning.block_lanes});
  }
}

void SearchStep::prepare(PixelType type) {
  if (coarse_match_) coarse_match_->prepare(type);
}

void SearchStep::plan_bands(const Plan& plan, const FrameImages& images, const Prediction& prediction, Map& coarse,
                            SearchBands& bands) {
  if (plan.has_coarse_match) coarse_match_->match(images, coarse);
  if (plan.search == Search::kBands) {
    const Map* found = plan.has_coarse_match ? &coarse : nullptr;
    search_band_.narrow(prediction.maps, found, bands, plan.matched);
  } else if (plan.predicts()) {
    search_band_.full_range(prediction.maps.disparity, bands, plan.matched);
  } else {
    search_band_.full_range(bands, plan.matched);
  }
}

}  // namespace egosgm
