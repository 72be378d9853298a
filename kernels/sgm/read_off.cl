// SPDX-License-Identifier: Apache-2.0
// The right view's disparities by the ranks that left pixels left there (sgm_cells.h): whole ones, to check the left
// view's by.
#include "sgm_cells.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Uints load_ranks(global const uint* row, const int x) {
#if PIXELS == 1
  return row[x];
#else
  return vload16(0, row + x);  // behind the row lies its padding
#endif
}

// Writes the right half of the maps.
COMPILED_ONCE void read_off_row(const WorkItem at, const SgmParameters q, global const uint* ranks,
                                global float* disparities, global float* variances) {
  const int y = at.y;
  if (y % q.row_step != 0) return;
  const size_t row = ((size_t)q.height + y) * q.width;
  global const uint* seen = ranks + (size_t)y * ((size_t)q.width + 2 * (size_t)q.padding) + q.padding;
  FOR_PIXELS(x, q.width) {
    const Uints rank = load_ranks(seen, x);
    const Ints is_seen = rank < NO_RANK;
    const Ints disparity = q.min_disparity + q.disparities - 1 - INTS_OF_UINTS(rank & 0xffffu);
    store_pixels(is_seen ? FLOATS_OF_INTS(disparity) : INVALID, disparities + row, x, q.width);
    store_pixels((Floats)(q.variance_floor), variances + row, x, q.width);
  }
}

KERNEL void read_off(const SgmParameters q, global const uint* ranks, global float* disparities,
                     global float* variances) {
  read_off_row(THIS_WORK_ITEM, q, ranks, disparities, variances);
}
