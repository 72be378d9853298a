// SPDX-License-Identifier: Apache-2.0
#include "host/match/consistency_check.h"

#include <utility>

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("ConsistencyCheck");
  return context.program("consistency_check.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

ConsistencyCheck::ConsistencyCheck(ocl::Context& context, shared::ImageSize size, int pixels)
    : context_((context.enter("ConsistencyCheck"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      no_doubt_(context, 1),
      check_(build(context, pixels_), "check") {
  no_doubt_.write(context, {shared::PredictionState{}});
}

void ConsistencyCheck::operator()(const Map& disparity, float max_difference_px, OutsideView outside, Map& kept,
                                  Map& variance, Views views) {
  (*this)(disparity, max_difference_px, max_difference_px, no_doubt_, outside, kept, variance, views);
}

void ConsistencyCheck::operator()(const Map& disparity, float max_difference_px, float in_doubt_px,
                                  const ocl::Buffer<shared::PredictionState>& last, OutsideView outside, Map& kept,
                                  Map& variance, Views views) {
  context_.enter("ConsistencyCheck");
  const cl_int keep_outside = outside == OutsideView::kKeep;
  check_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, max_difference_px, in_doubt_px,
         last, keep_outside, disparity, kept, variance);
}

}  // namespace egosgm
