// SPDX-License-Identifier: Apache-2.0
// Pixels whose band takes one block of several vectors. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_ONE_BLOCK_H
#define EGOSGM_KERNELS_MATCH_ONE_BLOCK_H

#include "compiler.h"
#include "recurrence.h"
#include "row.h"

#if BLOCK_VECTORS == 2

// The path costs of a pixel, which it leaves in the slots in place of those before it.
ALWAYS_INLINE void follow_block(const SgmParameters q, const Row* row, const uint extent, const uint steps,
                                const Block absent, const Block cost, Place* place, Block* r) {
  const int origin = origin_of(extent);
  uchar16 least[DIRECTIONS];
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    const uint moved = n > 0 ? place->moved : -(uint)q.min_disparity;
    global const uchar* from = row->slot[n] + (moved + (uint)origin);
    // A load one lane off a recent store would stall. The cost's minimum is still on it (see `FromLeft`).
    const bool beside = n == 0 && extent == place->wiped[0];
    const Block below = beside ? LANES_BELOW(place->last_block) : load_block(from - 1);
    const Block above = beside ? LANES_ABOVE(place->last_block) : load_block(from + 1);
    const Block same = beside ? place->last_block : load_block(from);
    const Block before = beside ? place->least_of_block : (Block)(0);
    const Block p1 = (Block)(n > 0 ? row->p1_across_rows.s0 : row->p1.s0);
    const Block p2 = saturated_sum(before, (Block)((uchar)(steps >> 8 * n)));
    r[n] = saturated_sum(cost, LEAST_WAY(same, below, above, p1, p2, least_of, saturated_sum) - before);
    least[n] = LEAST_OF_VECTORS(r[n]);
    wipe(row->slot[n] + (moved + (uint)origin_of(place->wiped[n])), place->wiped[n]);
  }
  minima(least, least);
  place->last_block = r[0];
  place->least_of_block = (Block)(least[0].s0);
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    r[n] = (r[n] - (Block)(least[n].s0)) | absent;
    store_block(r[n], row->slot[n] + ((n > 0 ? place->moved : -(uint)q.min_disparity) + (uint)origin));
  }
}

// The winner of a block with its neighbourhood; and offers the pixel to the right ones.
ALWAYS_INLINE void find_winner_of_block(const SgmParameters q, const Row* row, const int origin, const Block absent,
                                        const Block cost, const Block sum, const Place* place) {
  const int lane = (int)((uint)origin - (uint)q.min_disparity);
  const int first = row->bands[place->k].first - origin, last = row->bands[place->k].last - origin;
  const ushort16 totals[2] = {
      (convert_ushort16(FIRST_VECTOR(sum)) + convert_ushort16(load(place->cells))) | widened(FIRST_VECTOR(absent)),
      (convert_ushort16(SECOND_VECTOR(sum)) + convert_ushort16(load(place->cells + VECTOR))) |
          widened(SECOND_VECTOR(absent))};
  const ushort16 allowed[2] = {totals[0] | barred(first, last), totals[1] | barred(first - VECTOR, last - VECTOR)};
  // The least total in the upper bits, its lane in the lower five.
  const ushort16 lanes = convert_ushort16(kLane);
  const int rank = minimum_of_totals(
      min((allowed[0] << (ushort16)(5)) | lanes, (allowed[1] << (ushort16)(5)) | lanes | (ushort16)(VECTOR)));
  const int best_lane = rank & (BLOCK - 1), winner_total = rank >> 5;

  ushort all[BLOCK + 2 * MAX_STEPS];
  store_end(all);
  store_totals(totals[0], all + MAX_STEPS);
  store_totals(totals[1], all + MAX_STEPS + VECTOR);
  store_end(all + MAX_STEPS + BLOCK);
  put_window(all + MAX_STEPS + best_lane, &row->windows[place->k]);
  row->winners[place->k] = winner_at(origin + best_lane, winner_total << 4);
  if (!row->seen) return;
  global uint* seen = row->seen + place->k - origin;
  offer(allowed[0], winner_total, FIRST_VECTOR(cost), q.disparities - 1 - lane, seen);
  offer(allowed[1], winner_total, SECOND_VECTOR(cost), q.disparities - 1 - lane - VECTOR, seen - VECTOR);
}

// Matches a pixel, and leaves its sum, or with the other sweep's its winner.
ALWAYS_INLINE void match_block(const bool meets, const SgmParameters q, const Row* row, const uint extent,
                               const uint steps, Place* place) {
  const int origin = origin_of(extent);
  const Block absent = absent_in_block(q.disparities - (int)((uint)origin - (uint)q.min_disparity));
  const Block cost = absent | matching_cost_of_block(place->own, place->other + origin, row->row_above, row->row_below);
  Block r[DIRECTIONS];
  follow_block(q, row, extent, steps, absent, cost, place, r);
  const Block sum = half_sum_of_blocks(r);
  if (meets) {
    find_winner_of_block(q, row, origin, absent, cost, sum, place);
  } else {
    store_block(sum, place->cells);
  }
}

#endif

#endif
