// SPDX-License-Identifier: Apache-2.0
// Pixels whose bands take several vectors: matched in blocks, in two passes. OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_WIDE_H
#define EGOSGM_KERNELS_MATCH_WIDE_H

#include "compiler.h"
#include "cost.h"
#include "recurrence.h"
#include "slots.h"
#include "winner.h"

// A pixel with more than one vector.
typedef struct {
  global uchar* at[DIRECTIONS];        // its first disparity's place in the slot of each path
  global uchar* wiped_at[DIRECTIONS];  // and that of its predecessor's
  uint wiped[DIRECTIONS];              // the predecessors' extents
  bool is_wiped[DIRECTIONS];           // whether its own costs do not overwrite theirs
  uchar p1[DIRECTIONS], p2[DIRECTIONS];
  global const Code *own, *other;  // its code, and that of its first disparity
  long row_above, row_below;       // to the codes of these rows
  int disparities;                 // of the range, from its first one on
  global uchar* cells;
  int origin, first, last;  // of its band; the latter two count from its origin
  global uint* seen;        // the rank of the right pixel at its first disparity; null: none are kept
} Pixel;

// Results between the two passes: path costs before their minima are taken off, and matching costs.
typedef struct {
  Block t[DIRECTIONS][MAX_BLOCKS], cost[MAX_BLOCKS];
} PathCosts;

// The first pass: path costs of a block, and their least in each lane.
static inline void follow_paths(const Pixel* pixel, const int b, const Block absent, PathCosts* costs, Block* least) {
  const int at = BLOCK * b;
  const Block cost = absent | matching_cost_of_block(pixel->own, pixel->other + at, pixel->row_above, pixel->row_below);
  costs->cost[b] = cost;
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    global const uchar* from = pixel->at[n] + at;
    const Block way = LEAST_WAY(load_block(from), load_block(from - 1), load_block(from + 1), (Block)(pixel->p1[n]),
                                (Block)(pixel->p2[n]), least_of, saturated_sum);
    const Block t = saturated_sum(cost, way);
    costs->t[n][b] = t;
    least[n] = least_of(least[n], t);
  }
}

// The least total so far of each lane of a vector, and the vector that has it.
typedef struct {
  ushort16 total, vector;
} Best;

// Adds the other sweep's sums of a vector, and remembers the least.
static inline void add_sums(const Pixel* pixel, const int v, const uchar16 absent, const uchar16 sum, ushort* totals,
                            Best* best) {
  const int at = VECTOR * v;
  const ushort16 total = (convert_ushort16(sum) + convert_ushort16(load(pixel->cells + at))) | widened(absent);
  store_totals(total, totals + at);
  const int first = pixel->first - at, last = pixel->last - at;
  const bool is_inner = first <= 0 && last >= VECTOR - 1;
  const ushort16 allowed = is_inner ? total : total | barred(first, last);
  best->vector = select(best->vector, (ushort16)((ushort)v), allowed < best->total);
  best->total = min(best->total, allowed);
}

// The second pass: leaves a block's path costs in their slots, and half of their sum, or adds the other half.
static inline void leave_block(const bool meets, const bool is_tail, const Pixel* pixel, const int b,
                               const Block absent, const PathCosts* costs, const Block* least, ushort* totals,
                               Best* best) {
  Block r[DIRECTIONS];
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    r[n] = (costs->t[n][b] - least[n]) | absent;
    store_block(r[n], pixel->at[n] + BLOCK * b);
  }
  const Block sum = half_sum_of_blocks(r);
  if (meets) {
    add_sums(pixel, BLOCK_VECTORS * b, FIRST_VECTOR(absent), FIRST_VECTOR(sum), totals, best);
    if (BLOCK_VECTORS == 2 && !is_tail) {
      add_sums(pixel, BLOCK_VECTORS * b + 1, SECOND_VECTOR(absent), SECOND_VECTOR(sum), totals, best);
    }
  } else if (is_tail) {
    store(FIRST_VECTOR(sum), pixel->cells + BLOCK * b);
  } else {
    store_block(sum, pixel->cells + BLOCK * b);
  }
}

// The winner and its neighbourhood; and offers the pixel to the right ones.
static inline void find_winner(const Pixel* pixel, const int vectors, const PathCosts* costs, ushort* totals,
                               const Best* best, Window* window, int* winner) {
  store_end(totals - MAX_STEPS);
  store_end(totals + VECTOR * vectors);
  const ushort winner_total = minimum_of_totals(best->total);
  const ushort16 lanes = best->vector * (ushort16)(VECTOR) + convert_ushort16(kLane);
  const int best_lane = minimum_of_totals(lanes | as_ushort16(best->total != (ushort16)(winner_total)));
  put_window(totals + best_lane, window);
  *winner = winner_at(pixel->origin + best_lane, winner_total << 4);
  for (int v = 0; pixel->seen && v < vectors; ++v) {
    const int at = VECTOR * v;
    const ushort16 allowed = ((const Totals*)(totals + at))->totals | barred(pixel->first - at, pixel->last - at);
    offer(allowed, winner_total, ((const uchar16*)costs->cost)[v], pixel->disparities - 1 - at, pixel->seen - at);
  }
}

ALWAYS_INLINE void match_blocks(const bool meets, const int vectors, const Pixel* pixel, Window* window, int* winner) {
  const int blocks = vectors / BLOCK_VECTORS;
  const bool has_tail = vectors % BLOCK_VECTORS != 0;
  const Block tail = block_from(VECTOR) | absent_in_block(pixel->disparities - BLOCK * blocks);
  PathCosts costs;
  Block least[DIRECTIONS];
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) least[n] = (Block)(ABSENT);
  for (int b = 0; b < blocks; ++b)
    follow_paths(pixel, b, absent_in_block(pixel->disparities - BLOCK * b), &costs, least);
  if (has_tail) follow_paths(pixel, blocks, tail, &costs, least);

  uchar16 minimum[DIRECTIONS];
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) minimum[n] = LEAST_OF_VECTORS(least[n]);
  minima(minimum, minimum);
#pragma unroll
  for (int n = 0; n < DIRECTIONS; ++n) {
    least[n] = (Block)(minimum[n].s0);
    if (pixel->is_wiped[n]) wipe(pixel->wiped_at[n], pixel->wiped[n]);
  }

  ushort totals[MAX_BLOCKS * BLOCK + 2 * MAX_STEPS];
  Best best = {(ushort16)(65535), (ushort16)(0)};
  for (int b = 0; b < blocks; ++b) {
    const Block absent = absent_in_block(pixel->disparities - BLOCK * b);
    leave_block(meets, false, pixel, b, absent, &costs, least, totals + MAX_STEPS, &best);
  }
  if (has_tail) leave_block(meets, true, pixel, blocks, tail, &costs, least, totals + MAX_STEPS, &best);
  if (meets) find_winner(pixel, vectors, &costs, totals + MAX_STEPS, &best, window, winner);
}

#endif
