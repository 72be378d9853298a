// SPDX-License-Identifier: Apache-2.0
// Whether a frame's predictions were right. A gap leaves many pixels without one, a wrong motion contradicts what is
// measured, each far more than a frame before.
#include "method.h"
#include "shared.h"

#ifndef ROW_GROUP
#error "ROW_GROUP: work-items that share a row"
#endif

// lint: ROW_GROUP=1
// lint: ROW_GROUP=64

static inline PredictionCounts sum_of(const PredictionCounts a, const PredictionCounts b) {
  const PredictionCounts sum = {a.predicted + b.predicted, a.both + b.both, a.differing + b.differing};
  return sum;
}

// Of a group's lanes, by a barrier for all of them; right in the first one.
static inline PredictionCounts sum_of_lanes(local PredictionCounts* lanes, const PredictionCounts own) {
  const int lane = get_local_id(0);
  lanes[lane] = own;
  barrier(CLK_LOCAL_MEM_FENCE);
  PredictionCounts sum = own;
  for (int i = 1; lane == 0 && i < ROW_GROUP; ++i) sum = sum_of(sum, lanes[i]);
  return sum;
}

// Counts of every EGOSGM_CHECKED_ROWS-th row. A work-group of ROW_GROUP a row.
KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void count_predictions(
    const int width, global const float* warped, global const float* predicted, global const float* measured,
    global PredictionCounts* row_counts) {
  const int lane = get_local_id(0);
  const size_t row = (size_t)get_global_id(1) * EGOSGM_CHECKED_ROWS * width;
  local PredictionCounts lanes[ROW_GROUP];
  uint with_prediction = 0;
  uint with_both = 0;
  uint that_differ = 0;
  for (int x = lane; x < width; x += ROW_GROUP) {
    const float d = predicted[row + x];
    const float z = measured[row + x];
    // A prediction that only fills a gap is a guess, by which what comes into the view looks like a wrong motion.
    const int both =
        (warped[row + x] > EGOSGM_INVALID_DISPARITY) & (d > EGOSGM_INVALID_DISPARITY) & (z > EGOSGM_INVALID_DISPARITY);
    with_prediction += d > EGOSGM_INVALID_DISPARITY ? 1 : 0;
    with_both += both;
    that_differ += both & (fabs(z - d) > EGOSGM_CHECKED_DIFFERENCE_PX);
  }
  const PredictionCounts own = {with_prediction, with_both, that_differ};
  const PredictionCounts sum = sum_of_lanes(lanes, own);
  if (lane == 0) row_counts[get_global_id(1)] = sum;
}

// Less than three quarters as many predictions as a frame before; or twice its share of contradictions and 2.5 % more.
static inline int are_wrong(const PredictionCounts now, const PredictionCounts before) {
  const ulong differing = (ulong)now.differing * before.both;
  const ulong differed = (ulong)before.differing * now.both;
  const ulong both = (ulong)now.both * before.both;
  return before.both > 0 &&
         (4 * (ulong)now.predicted < 3 * (ulong)before.predicted || differing > 2 * differed + both / 40);
}

// A single work-group of ROW_GROUP.
KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void judge(const int rows,
                                                                         global const PredictionCounts* row_counts,
                                                                         global const PredictionState* before,
                                                                         global PredictionState* after) {
  local PredictionCounts lanes[ROW_GROUP];
  PredictionCounts own = {0, 0, 0};
  for (int i = get_local_id(0); i < rows; i += ROW_GROUP) own = sum_of(own, row_counts[i]);
  const PredictionCounts sum = sum_of_lanes(lanes, own);
  if (get_local_id(0) == 0) {
    after->counts = sum;
    after->is_wrong = are_wrong(sum, before->counts);
    after->was_wrong = before->is_wrong;
  }
}
