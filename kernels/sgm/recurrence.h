// SPDX-License-Identifier: Apache-2.0
// A step of the recurrence along a path, and the sum over paths. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_RECURRENCE_H
#define EGOSGM_KERNELS_MATCH_RECURRENCE_H

#include "lanes.h"

// t(d) of one path, from the predecessor's costs at the same 16 disparities and at those one below and one above.
static inline uchar16 path_cost(const uchar16 cost, const uchar16 same, const uchar16 below, const uchar16 above,
                                const uchar16 p1, const uchar16 p2) {
  return add_sat(cost, min(min(same, add_sat(min(below, above), p1)), p2));
}

// The same where the predecessor's costs lie in a slot, `from` at the first of the 16 disparities.
static inline uchar16 path_cost_from(global const uchar* from, const uchar16 cost, const uchar16 p1, const uchar16 p2) {
  return path_cost(cost, load(from), load(from - 1), load(from + 1), p1, p2);
}

// The same where they are at hand and nothing lies beside them.
static inline uchar16 path_cost_beside(const uchar16 before, const uchar16 cost, const uchar16 p1, const uchar16 p2) {
  const uchar16 below = before.s00123456789abcde | (uchar16)(ABSENT, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  const uchar16 above = before.s123456789abcdeff | (uchar16)(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, ABSENT);
  return path_cost(cost, before, below, above, p1, p2);
}

// As `mean_of` has it of blocks.
static inline uchar16 mean(const uchar16 a, const uchar16 b) {
  return convert_uchar16((convert_ushort16(a) + convert_ushort16(b) + (ushort16)(1)) >> (ushort16)(1));
}

// Half of the sum over all paths, in 8 bits: (L0 + L1 + 1) / 2 + (L2 + L3 + 1) / 2, at most 255.
static inline uchar16 half_sum(const uchar16* r) {
#if PATHS == 8
  return add_sat(mean(r[0], r[1]), mean(r[2], r[3]));
#else
  return add_sat(r[0], r[1]);
#endif
}

static inline Block half_sum_of_blocks(const Block* r) {
#if PATHS == 8
  return saturated_sum(mean_of(r[0], r[1]), mean_of(r[2], r[3]));
#else
  return saturated_sum(r[0], r[1]);
#endif
}

#endif
