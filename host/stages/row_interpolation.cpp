// SPDX-License-Identifier: Apache-2.0
#include "host/stages/row_interpolation.h"

namespace egosgm {

RowInterpolation::RowInterpolation(ocl::Context& context, shared::ImageSize size, int pixels)
    : stage_(context, "RowInterpolation", "row_interpolation.cl", size, pixels),
      interpolate_(stage_, "interpolate_rows") {}

void RowInterpolation::interpolate(int right_row_step, Map& disparity, Map& variance) {
  stage_.launch_pixels(interpolate_, /*views=*/1, right_row_step, disparity, variance);
}

}  // namespace egosgm
