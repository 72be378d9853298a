// SPDX-License-Identifier: Apache-2.0
#include "host/method/match_step.h"

#include "host/stages/evidence.h"

namespace egosgm {
namespace {

std::optional<BandedSgmPaths::Group> path_group(const Tuning& tuning) {
  if (tuning.path_lanes == 0) return {};
  return BandedSgmPaths::Group{tuning.path_lanes, tuning.path_lines};
}

}  // namespace

MatchStep::MatchStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options, const Tuning& tuning)
    : left_right_(options.consistency),
      matcher_(context, size, range_of(options), options.banded_sgm,
               {path_group(tuning), {tuning.tile_width, tuning.tile_height, tuning.block_lanes}}),
      consistency_(context, size),
      speckle_removal_(context, size, options.speckle_removal, tuning.speckle_strip_rows, tuning.row_group),
      removes_speckles_(options.speckle_removal.max_size_px > 0),
      judges_by_evidence_(Evidence::is_of(options)) {
  if (options.median_filter.enabled) median_filter_.emplace(context, size);
  if (options.temporal && !options.track_right) matcher_.prepare_reading_off();
}

void MatchStep::measure(const Plan& plan, const FrameImages& images, const SearchBands& bands, Matching& matching,
                        StereoMaps& measured) {
  const bool reads_off = plan.matched.count == 1;
  const Views views{2, plan.matched.row_step};
  StereoMaps matched{matching.matched, measured.variance};
  if (reads_off) {
    matcher_.reading_off(images, bands, matched, plan.matched, plan.coded_rows());
  } else {
    matcher_.match(images, bands, matched, plan.matched, plan.coded_rows());
  }
  if (median_filter_) median_filter_->filter(matching.matched, matching.smoothed, views);
  const Map& smoothed = median_filter_ ? matching.smoothed : matching.matched;
  consistency_.check(smoothed, reads_off ? left_right_.read_off_px : left_right_.measurement_px, OutsideView::kDrop,
                     measured.disparity, views);
  if (removes_speckles(plan)) speckle_removal_.remove(measured.disparity, plan.matched);
}

}  // namespace egosgm
