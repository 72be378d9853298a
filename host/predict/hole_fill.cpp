// SPDX-License-Identifier: Apache-2.0
#include "host/predict/hole_fill.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("HoleFill");
  return context.program("hole_fill.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

HoleFill::HoleFill(ocl::Context& context, shared::ImageSize size, const HoleFillOptions& options, int pixels)
    : context_((context.enter("HoleFill"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      max_difference_px_(options.max_difference_px),
      fill_rows_(build(context, pixels_), "fill_rows"),
      fill_columns_(build(context, pixels_), "fill_columns"),
      rows_filled_(Map(context, ocl::Scratch::kOfStage0, 2 * pixel_count(size)),
                   Map(context, ocl::Scratch::kOfStage1, 2 * pixel_count(size))) {}

void HoleFill::fill(const StereoMaps& in, StereoMaps& out, FlagMap& hidden, Views views) {
  context_.enter("HoleFill");
  const ocl::Range pixels = ocl::every_pixels(context_, size_, pixels_, count(views));
  fill_rows_(context_, pixels, size_, max_difference_px_, in.disparity, in.variance, rows_filled_.disparity,
             rows_filled_.variance);
  fill_columns_(context_, pixels, size_, max_difference_px_, rows_filled_.disparity, rows_filled_.variance,
                out.disparity, out.variance, hidden);
}

}  // namespace egosgm
