// SPDX-License-Identifier: Apache-2.0
#include "host/hole_fill.h"

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context) {
  context.enter("HoleFill");
  return context.program("hole_fill.cl", {});
}

}  // namespace

HoleFill::HoleFill(ocl::Context& context, shared::ImageSize size, const HoleFillOptions& options)
    : context_(context),
      size_(size),
      max_difference_px_(options.max_difference_px),
      fill_rows_(build(context), "fill_rows"),
      fill_columns_(build(context), "fill_columns"),
      rows_filled_(context, size) {}

void HoleFill::operator()(const StereoMaps& in, StereoMaps& out) {
  context_.enter("HoleFill");
  const ocl::Range pixels = ocl::every_pixel(context_, size_);
  fill_rows_(context_, pixels, size_, max_difference_px_, in.disparity, in.variance, rows_filled_.disparity,
             rows_filled_.variance);
  fill_columns_(context_, pixels, size_, max_difference_px_, rows_filled_.disparity, rows_filled_.variance,
                out.disparity, out.variance);
}

}  // namespace egosgm
