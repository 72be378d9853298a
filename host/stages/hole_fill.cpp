// SPDX-License-Identifier: Apache-2.0
#include "host/stages/hole_fill.h"

namespace egosgm {

HoleFill::HoleFill(ocl::Context& context, shared::ImageSize size, const HoleFillOptions& options, int pixels)
    : stage_(context, "HoleFill", "hole_fill.cl", size, pixels),
      max_difference_px_(options.max_difference_px),
      fill_rows_(stage_, "fill_rows"),
      fill_columns_(stage_, "fill_columns"),
      rows_filled_(Map(context, ocl::Scratch::kOfStage0, 2 * pixel_count(size)),
                   Map(context, ocl::Scratch::kOfStage1, 2 * pixel_count(size))) {}

void HoleFill::fill(const StereoMaps& in, StereoMaps& out, FlagMap& hidden, Views views) {
  stage_.launch_pixels(fill_rows_, views.count, views.row_step, max_difference_px_, in.disparity, in.variance,
                       rows_filled_.disparity, rows_filled_.variance);
  stage_.launch_pixels(fill_columns_, views.count, views.row_step, max_difference_px_, rows_filled_.disparity,
                       rows_filled_.variance, out.disparity, out.variance, hidden);
}

}  // namespace egosgm
