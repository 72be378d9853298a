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
    : context_(context), size_(size), max_difference_px_(options.max_difference_px), fill_(build(context), "fill") {}

void HoleFill::operator()(const StereoMaps& in, StereoMaps& out) {
  context_.enter("HoleFill");
  fill_(context_, ocl::every_pixel(context_, size_), size_, max_difference_px_, in.disparity, in.variance,
        out.disparity, out.variance);
}

}  // namespace egosgm
