// SPDX-License-Identifier: Apache-2.0
// The median of 3x3 disparities, in both views. A neighbour outside the image or without a value votes for the centre; a centre
// without a value gets the median (the upper of two middle ones) of its neighbours if at least `fill_from` of the eight have one.
#include "shared.h"

static inline float lower(const float a, const float b) { return a < b ? a : b; }
static inline float upper(const float a, const float b) { return a < b ? b : a; }
static inline float median(const float a, const float b, const float c) {
  return upper(lower(a, b), lower(upper(a, b), c));
}

typedef struct {
  float low, middle, high;
} Sorted;

static inline Sorted sort(const float a, const float b, const float c) {
  Sorted sorted;
  sorted.low = lower(lower(a, b), c);
  sorted.middle = median(a, b, c);
  sorted.high = upper(upper(a, b), c);
  return sorted;
}

kernel void filter(const ImageSize size, const int fill_from, global const float* disparity, global float* filtered,
                   global float* variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + y) * size.width + x;
  const int has_left = x >= 1;
  const int has_right = x + 1 < size.width;
  const int has_above = y >= 1;
  const int has_below = y + 1 < size.height;
  // Rows outside the image are read where they are not used.
  const size_t above = has_above ? i - size.width : i;
  const size_t below = has_below ? i + size.width : i;
  const float none = EGOSGM_INVALID_DISPARITY;

  const float d = disparity[i];
  const int is_hole = d == none;
  int holes = 0;
  // Without a centre to vote for, neighbours without a value vote high and low by turns, which leaves the median of the others.
#define VOTE(vote, exists, index)                                        \
  const float neighbour_##vote = (exists) ? disparity[index] : none;    \
  const int absent_##vote = neighbour_##vote == none;                   \
  const float abstained_##vote = is_hole ? (holes & 1 ? HIGH : LOW) : d; \
  holes += absent_##vote;                                               \
  const float vote = absent_##vote ? abstained_##vote : neighbour_##vote;
#define HIGH 1e30f
#define LOW -1e30f
  VOTE(left_above, has_above && has_left, above - 1)
  VOTE(left_beside, has_left, i - 1)
  VOTE(left_below, has_below && has_left, below - 1)
  VOTE(just_above, has_above, above)
  VOTE(just_below, has_below, below)
  VOTE(right_above, has_above && has_right, above + 1)
  VOTE(right_beside, has_right, i + 1)
  VOTE(right_below, has_below && has_right, below + 1)
  const float centre_vote = is_hole ? HIGH : d;

  const Sorted left = sort(left_above, left_beside, left_below);
  const Sorted centre = sort(just_above, centre_vote, just_below);
  const Sorted right = sort(right_above, right_beside, right_below);
  // The median of nine is the median of: the largest of the columns' lowest, the median of their medians, the smallest
  // of their highest.
  const float middle = median(upper(upper(left.low, centre.low), right.low),
                              median(left.middle, centre.middle, right.middle),
                              lower(lower(left.high, centre.high), right.high));
  const int is_filled = is_hole & (8 - holes >= fill_from);
  filtered[i] = is_hole != is_filled ? none : middle;
  variance[i] = is_filled ? EGOSGM_FILLED_VARIANCE_PX2 : variance[i];
}
