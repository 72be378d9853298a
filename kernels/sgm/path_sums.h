// SPDX-License-Identifier: Apache-2.0
// The path sums of a pixel, and its winner (banded_sgm_paths.cl). OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_PATH_SUMS_H
#define EGOSGM_KERNELS_MATCH_PATH_SUMS_H

#include "vector.h"

#define MAX_STEPS 8
#define NO_WINNER 0xffffffffu

// The place where a path leaves its costs: alone, or as their mean with those of the path that left its own there.
typedef struct {
  global uchar* of_cells;
  bool joins;
} Sums;

static inline void add_path(const Sums sums, const Bytes earlier, const Costs costs, const long cell) {
  const Bytes bytes = BYTES_OF(min(costs, (Costs)(255)));
  store(sums.joins ? mean(earlier, bytes) : bytes, sums.of_cells + cell);
}

// The partial sums of a pixel's cells, and which of them exist, [first, end).
typedef struct {
  global const uchar *forward_first, *forward_second, *backward_first, *backward_second;
  int first, end;
} Cells;

// Half the sums over all paths, of a vector of cells.
static inline Totals totals_of(const Cells cells, const int at) {
  const Bytes forward = saturated_sum(load(cells.forward_first + at), load(cells.forward_second + at));
  const Bytes backward = saturated_sum(load(cells.backward_first + at), load(cells.backward_second + at));
  return TOTALS_OF(forward) + TOTALS_OF(backward);
}

// Sums in the upper halves, the index in the lower ones, so that the smallest disparity wins a tie; NO_WINNER
// outside of the band.
static inline Ranks allowed_of(const Cells cells, const int at, const int first, const int last) {
  const Ranks index = (Ranks)((uint)at) + (Ranks)(INDEX);
  const Ranks ranked = RANKS_OF(totals_of(cells, at)) << (Ranks)(16) | index;
  return index < (Ranks)((uint)first) || index > (Ranks)((uint)last) ? (Ranks)(NO_WINNER) : ranked;
}

// The total of one.
static inline int total_of(const Cells cells, const int at) {
  return (int)add_sat(cells.forward_first[at], cells.forward_second[at]) +
         add_sat(cells.backward_first[at], cells.backward_second[at]);
}

// Steps to one side of the winner until the sums above its own add up to `limit`.
static inline int count_steps(const Cells cells, const int winner, const int total, const int step, const int limit) {
  int sum = 0, steps = 0;
  for (int at = winner + step; steps < MAX_STEPS && at >= cells.first && at < cells.end; at += step) {
    sum += max(0, total_of(cells, at) - total);
    if (sum >= limit) break;
    ++steps;
  }
  return steps;
}

#endif
