// SPDX-License-Identifier: Apache-2.0
#include "host/stages/consistency_check.h"

namespace egosgm {

ConsistencyCheck::ConsistencyCheck(ocl::Context& context, shared::ImageSize size, int pixels)
    : stage_(context, "ConsistencyCheck", "consistency_check.cl", size, pixels), check_(stage_, "check") {}

void ConsistencyCheck::check(const Map& disparity, float max_difference_px, OutsideView outside, Map& kept,
                             Views views) {
  const cl_int keep_outside = outside == OutsideView::kKeep;
  stage_.launch_pixels(check_, views.count, views.row_step, max_difference_px, keep_outside, disparity, kept);
}

}  // namespace egosgm
