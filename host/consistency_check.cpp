// SPDX-License-Identifier: Apache-2.0
#include "host/consistency_check.h"

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context) {
  context.enter("ConsistencyCheck");
  return context.program("consistency_check.cl", {});
}

}  // namespace

ConsistencyCheck::ConsistencyCheck(ocl::Context& context, shared::ImageSize size)
    : context_(context), size_(size), check_(build(context), "check") {}

void ConsistencyCheck::operator()(const StereoMaps& in, float max_difference_px, OutsideView outside, StereoMaps& out) {
  context_.enter("ConsistencyCheck");
  const cl_int keep_outside = outside == OutsideView::kKeep;
  check_(context_, ocl::every_pixel(context_, size_), size_, max_difference_px, keep_outside, in.disparity, in.variance,
         out.disparity, out.variance);
}

}  // namespace egosgm
