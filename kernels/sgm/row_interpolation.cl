// SPDX-License-Identifier: Apache-2.0
// The rows of the right view between those that BandedSgm matches (sgm_cells.h): the mean of the rows above and below
// where these agree, else the surer of the two; behind the last one that is matched, that one.
#include "method.h"
#include "pixels.h"
#include "sgm_cells.h"

// lint: PIXELS=1
// lint: PIXELS=16

// Writes the right half of the maps.
COMPILED_ONCE void interpolate_row(const WorkItem at, const SgmParameters q, global float* disparities,
                                   global float* variances) {
  const int own = at.y, above = own - own % q.right_row_step, next = above + q.right_row_step;
  if (own == above) return;
  const int below = next < q.height ? next : above;
  const size_t view = (size_t)q.height * q.width;
  const size_t row = view + (size_t)own * q.width;
  const size_t row_above = view + (size_t)above * q.width, row_below = view + (size_t)below * q.width;
  FOR_PIXELS(x, q.width) {
    const Floats d = load_pixels(disparities + row_above, x, q.width),
                 p = load_pixels(variances + row_above, x, q.width);
    const Floats e = load_pixels(disparities + row_below, x, q.width),
                 r = load_pixels(variances + row_below, x, q.width);
    const Ints agree = fabs(d - e) <= (Floats)(EGOSGM_ROWS_AGREE_PX), takes_below = r < p;
    store_pixels(agree ? 0.5f * (d + e) : takes_below ? e : d, disparities + row, x, q.width);
    store_pixels(agree ? 0.5f * (p + r) : takes_below ? r : p, variances + row, x, q.width);
  }
}

KERNEL void interpolate_rows(const SgmParameters q, global float* disparities, global float* variances) {
  interpolate_row(THIS_WORK_ITEM, q, disparities, variances);
}
