// SPDX-License-Identifier: Apache-2.0
// The rows of the right view between those that a frame with a prediction has, for who wants them: the mean of the rows
// above and below where these agree, else the surer of the two; behind the last one, that one. What one of the rows
// does not have stays unknown.
#include "method.h"
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

// Writes the right half of the maps.
COMPILED_ONCE void interpolate_row(const WorkItem at, const ImageSize size, const int right_row_step,
                                   global float* disparities, global float* variances) {
  const int own = at.y, above = own - own % right_row_step, next = above + right_row_step;
  if (own == above) return;
  const int below = next < size.height ? next : above, width = size.width;
  const size_t view = (size_t)size.height * width;
  const size_t row = view + (size_t)own * width;
  const size_t row_above = view + (size_t)above * width, row_below = view + (size_t)below * width;
  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparities + row_above, x, width), p = load_pixels(variances + row_above, x, width);
    const Floats e = load_pixels(disparities + row_below, x, width), r = load_pixels(variances + row_below, x, width);
    const Ints agree = fabs(d - e) <= (Floats)(EGOSGM_ROWS_AGREE_PX), takes_below = r < p;
    const Floats between = agree ? 0.5f * (d + e) : takes_below ? e : d;
    store_pixels((is_valid(d) & is_valid(e)) ? between : INVALID, disparities + row, x, width);
    store_pixels(agree ? 0.5f * (p + r) : takes_below ? r : p, variances + row, x, width);
  }
}

KERNEL void interpolate_rows(const ImageSize size, const int right_row_step, global float* disparities,
                             global float* variances) {
  interpolate_row(THIS_WORK_ITEM, size, right_row_step, disparities, variances);
}
