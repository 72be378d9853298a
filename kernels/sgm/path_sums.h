// SPDX-License-Identifier: Apache-2.0
// The path sums of a pixel, and its winner (banded_sgm_paths.cl). OpenCL C only.
#ifndef EGOSGM_KERNELS_MATCH_PATH_SUMS_H
#define EGOSGM_KERNELS_MATCH_PATH_SUMS_H

#include "vector.h"

#define MAX_STEPS 8
#define NO_WINNER 0xffffffffu

// The place where a launch leaves the costs of its paths. `stage` 0: horizontal (and `vertical`) paths, 1 and 2: the
// diagonals.
typedef struct {
  int stage;
  bool vertical;
  global uchar *first, *second;
} Sums;

// The sums that lie in a vector of cells already.
typedef struct {
  Bytes first, second;
} Earlier;

static inline Earlier earlier_at(const Sums sums, const long cell) {
  Earlier earlier = {0, 0};
  if (sums.stage > 0) {
    earlier.first = load(sums.first + cell);
    earlier.second = load(sums.second + cell);
  }
  return earlier;
}

static inline void add_path(const Sums sums, const Earlier earlier, const Costs costs, const long cell) {
  const Bytes bytes = BYTES_OF(min(costs, (Costs)(255)));
  if (sums.stage == 0) {
    store(bytes, (sums.vertical ? sums.second : sums.first) + cell);
  } else if (sums.stage == 1) {
    store(mean(earlier.first, earlier.second), sums.first + cell);
    store(bytes, sums.second + cell);
  } else {
    store(saturated_sum(earlier.first, mean(earlier.second, bytes)), sums.first + cell);
  }
}

// The partial sums of a pixel's cells, and which of them exist, [first, end).
typedef struct {
  global const uchar *forward_first, *forward_second, *backward_first, *backward_second;
  int first, end;
} Cells;

// Half the sums over all paths, of a vector of cells.
static inline Totals totals_of(const Cells cells, const int at) {
  Bytes forward = load(cells.forward_first + at), backward = load(cells.backward_first + at);
#if PATHS == 4
  forward = saturated_sum(forward, load(cells.forward_second + at));
  backward = saturated_sum(backward, load(cells.backward_second + at));
#endif
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
  uchar forward = cells.forward_first[at], backward = cells.backward_first[at];
#if PATHS == 4
  forward = add_sat(forward, cells.forward_second[at]);
  backward = add_sat(backward, cells.backward_second[at]);
#endif
  return (int)forward + backward;
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
