// SPDX-License-Identifier: Apache-2.0
// Pixels whose band fits one vector. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_NARROW_H
#define EGOSGM_KERNELS_MATCH_NARROW_H

#include "compiler.h"
#include "recurrence.h"
#include "row.h"

// t(d) where the predecessor's costs lie in a slot, `from` at the first of the 16 disparities.
static inline uchar16 path_cost_from(global const uchar* from, const uchar16 cost, const uchar16 p1, const uchar16 p2) {
  return add_sat(cost, LEAST_WAY(load(from), load(from - 1), load(from + 1), p1, p2, min, add_sat));
}

// The path cost where the predecessor's costs are at hand and nothing lies beside them.
static inline uchar16 path_cost_beside(const uchar16 before, const uchar16 cost, const uchar16 p1, const uchar16 p2) {
  const uchar16 below = before.s00123456789abcde | (uchar16)(ABSENT, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
  const uchar16 above = before.s123456789abcdeff | (uchar16)(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, ABSENT);
  return add_sat(cost, LEAST_WAY(before, below, above, p1, p2, min, add_sat));
}

// The path costs of a pixel, which it leaves in the slots in place of those before it.
ALWAYS_INLINE void follow_narrow(const SgmParameters q, const Row* row, const uint extent, const uint steps,
                                 const uchar16 absent, const uchar16 cost, Place* place, uchar16* r) {
  const uint lane = (uint)origin_of(extent) - (uint)q.min_disparity,
             moved_lane = place->moved + (uint)origin_of(extent);
  const uchar4 each = as_uchar4(steps);
  const uchar16 p2[4] = {each.s0000000000000000, each.s1111111111111111, each.s2222222222222222,
                         each.s3333333333333333};
  if (extent == place->wiped[0]) {
    r[0] = path_cost_beside(place->last, cost, row->p1, p2[0]);
  } else {
    r[0] = path_cost_from(row->slot[0] + lane, cost, row->p1, p2[0]);
    wipe(row->slot[0] + (origin_of(place->wiped[0]) - q.min_disparity), place->wiped[0]);
  }
#pragma unroll
  for (int n = 1; n < DIRECTIONS; ++n) {
    r[n] = path_cost_from(row->slot[n] + moved_lane, cost, row->p1_across_rows, p2[n]);
    wipe(row->slot[n] + (place->moved + (uint)origin_of(place->wiped[n])), place->wiped[n]);
  }
  uchar16 least[DIRECTIONS];
  minima(r, least);
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    r[n] = (r[n] - least[n]) | absent;
    store(r[n], row->slot[n] + (n > 0 ? moved_lane : lane));
  }
  place->last = r[0];
}

// Matches a pixel, and leaves its sum, or with the other sweep's its winner.
ALWAYS_INLINE void match_narrow(const bool meets, const SgmParameters q, const Row* row, const uint extent,
                                const uint steps, Place* place) {
  const int origin = origin_of(extent), lane = (int)((uint)origin - (uint)q.min_disparity);
  const uchar16 absent = lanes_from(EGOSGM_LANES * chunks_of(extent)) | absent_from(q.disparities - lane);
  const uchar16 cost = absent | matching_cost(place->own, place->other + origin, row->row_above, row->row_below);
  uchar16 r[DIRECTIONS];
  follow_narrow(q, row, extent, steps, absent, cost, place, r);
  const uchar16 sum = half_sum(r);
  if (meets) {
    const ushort16 total = (convert_ushort16(sum) + convert_ushort16(load(place->cells))) | widened(absent);
    const int first = row->bands[place->k].first - origin, last_of_band = row->bands[place->k].last - origin;
    row->windows[place->k] = (Window)(~0ul, ~0ul, as_ulong4(total), ~0ul, ~0ul);
    const ushort16 allowed = total | barred(first, last_of_band);
    const int rank = ranked(allowed);
    if (row->seen) {
      offer(allowed, rank >> 4, cost, q.disparities - 1 - lane, row->seen + place->k - origin);
    }
    row->winners[place->k] = winner_at(origin + (rank & 15), rank);
  } else if (is_chunk(extent)) {
    store_chunk(sum.lo, place->cells);
  } else {
    store(sum, place->cells);
  }
}

#endif
