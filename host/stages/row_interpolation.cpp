// SPDX-License-Identifier: Apache-2.0
#include "host/stages/row_interpolation.h"

namespace egosgm {

RowInterpolation::RowInterpolation(ocl::Context& context, shared::ImageSize size, int pixels)
    : stage_(context, "RowInterpolation", "row_interpolation.cl", size, pixels),
      interpolate_(stage_, "interpolate_rows") {}

void RowInterpolation::interpolate(cl_int view, shared::RowSteps steps, Map& disparity, Map& variance) {
  const cl_int step = shared::row_step_of(view, steps);
  if (step > 1) stage_.launch_pixels(interpolate_, /*views=*/1, view, step, disparity, variance);
}

}  // namespace egosgm
