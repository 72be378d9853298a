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
      check_(build(context, pixels_), "check") {}

void ConsistencyCheck::check(const Map& disparity, float max_difference_px, OutsideView outside, Map& kept,
                             Views views) {
  context_.enter("ConsistencyCheck");
  const cl_int keep_outside = outside == OutsideView::kKeep;
  check_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, max_difference_px, keep_outside,
         disparity, kept);
}

}  // namespace egosgm
