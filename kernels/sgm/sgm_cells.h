// SPDX-License-Identifier: Apache-2.0
// The disparity and variance of a winner, for both forms of BandedSgm (banded_sgm.cl, banded_sgm_paths.cl). OpenCL C
// only.
#ifndef EGOSGM_KERNELS_SGM_CELLS_H
#define EGOSGM_KERNELS_SGM_CELLS_H

#include "method.h"
#include "pixels.h"

// The rank of a left pixel for a right one (method.h) in its upper half, in the lower one how far the disparity lies
// behind the range's nearest one, so that of what fits alike the nearer is taken. Cells outside of the band, of 65535,
// stay where they are.
#define RANK(totals, least, costs)                        \
  add_sat(totals, (costs) * (ushort)(EGOSGM_RANK_COSTS) + \
                      (ushort)(EGOSGM_RANK_ADDED - EGOSGM_RANK_LEAST_QUARTERS * (int)(least) / 4))
#define NO_RANK 0xffff0000u  // and above: of no left pixel, or of a disparity that it does not search

// The number of rows of a view that are matched.
static inline int rows_of(const SgmParameters q) { return (q.height + q.row_step - 1) / q.row_step; }

// Disparity with its sub-pixel part, by a symmetric V through the winner and its neighbours, whose sums lie that much
// above its own; 0 both where one is missing.
static inline Floats refined(const Ints winner, const Ints rise_before, const Ints rise_after) {
  const Floats before = FLOATS_OF_INTS(rise_before), after = FLOATS_OF_INTS(rise_after);
  const Floats slope = max(before, after);
  const Ints is_risen = slope > 0.0f;
  const Floats offset = (before - after) / (2.0f * (is_risen ? slope : (Floats)(1.0f)));
  return FLOATS_OF_INTS(winner) + (is_risen ? clamp(offset, -0.5f, 0.5f) : (Floats)(0.0f));
}

// The matching variance (options.h).
static inline Floats matching_variance(const SgmParameters q, const Ints steps) {
  const Floats n = FLOATS_OF_INTS(steps);
  return q.variance_floor + n * (q.variance_per_step + q.variance_per_square * n);
}

#endif
