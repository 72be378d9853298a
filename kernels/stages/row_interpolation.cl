// SPDX-License-Identifier: Apache-2.0
// The rows of a view between those that are there: the mean of the rows above and below where these agree, nothing
// where they do not, and what one of them has where the other has nothing. Behind the last row, that one.
#include "method.h"
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

COMPILED_ONCE void interpolate_row(const WorkItem at, const ImageSize size, const int row_step,
                                   global float* disparities, global float* variances) {
  const int own = at.y, above = own - own % row_step, next = above + row_step;
  if (own == above) return;
  const int below = next < size.height ? next : above, width = size.width;
  const size_t first = (size_t)at.view * size.height * width, row = first + (size_t)own * width;
  const size_t row_above = first + (size_t)above * width, row_below = first + (size_t)below * width;
  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparities + row_above, x, width), p = load_pixels(variances + row_above, x, width);
    const Floats e = load_pixels(disparities + row_below, x, width), r = load_pixels(variances + row_below, x, width);
    const Ints is_above = is_valid(d), is_below = is_valid(e);
    const Ints agree = is_above & is_below & (fabs(d - e) <= (Floats)(EGOSGM_ROWS_AGREE_PX));
    const Ints is_nothing = is_above == is_below;
    const Floats disparity = is_nothing ? INVALID : is_above ? d : e;
    const Floats variance = is_nothing ? (Floats)(0.0f) : is_above ? p : r;
    store_pixels(agree ? 0.5f * (d + e) : disparity, disparities + row, x, width);
    store_pixels(agree ? 0.5f * (p + r) : variance, variances + row, x, width);
  }
}

KERNEL void interpolate_rows(const ImageSize size, const int row_step, global float* disparities,
                             global float* variances) {
  interpolate_row(THIS_WORK_ITEM, size, row_step, disparities, variances);
}
