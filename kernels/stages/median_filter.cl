// SPDX-License-Identifier: Apache-2.0
// The median of 3x3 disparities, in both views. A neighbour outside the image or without a value votes for the centre;
// a centre without a value stays one. Rows above and below are the next ones that the view has.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Floats lower(const Floats a, const Floats b) { return a < b ? a : b; }
static inline Floats upper(const Floats a, const Floats b) { return a < b ? b : a; }
static inline Floats median(const Floats a, const Floats b, const Floats c) {
  return upper(lower(a, b), lower(upper(a, b), c));
}

typedef struct {
  Floats low, middle, high;
} Sorted;

static inline Sorted sort(const Floats a, const Floats b, const Floats c) {
  Sorted sorted;
  sorted.low = lower(lower(a, b), c);
  sorted.middle = median(a, b, c);
  sorted.high = upper(upper(a, b), c);
  return sorted;
}

// One block, of rows that begin at `here` and `filtered`.
ALWAYS_INLINE void filter_block(const int x, const int width, const int has_above, const int has_below,
                                const int stride, global const float* here, global float* filtered) {
  // Rows outside the image are read where they are not used.
  global const float* above = has_above ? here - stride : here;
  global const float* below = has_below ? here + stride : here;
  const Floats d = load_pixels(here, x, width);
#define VOTE(vote, exists, from, column)                                                 \
  const Floats neighbour_##vote = (exists) ? load_pixels(from, column, width) : INVALID; \
  const Floats vote = neighbour_##vote == INVALID ? d : neighbour_##vote;
  VOTE(left_above, has_above, above, x - 1)
  VOTE(left_beside, 1, here, x - 1)
  VOTE(left_below, has_below, below, x - 1)
  VOTE(just_above, has_above, above, x)
  VOTE(just_below, has_below, below, x)
  VOTE(right_above, has_above, above, x + 1)
  VOTE(right_beside, 1, here, x + 1)
  VOTE(right_below, has_below, below, x + 1)

  const Sorted left = sort(left_above, left_beside, left_below);
  const Sorted centre = sort(just_above, d, just_below);
  const Sorted right = sort(right_above, right_beside, right_below);
  // The median of nine is the median of: the largest of the columns' lowest, the median of their medians, the
  // smallest of their highest.
  const Floats middle =
      median(upper(upper(left.low, centre.low), right.low), median(left.middle, centre.middle, right.middle),
             lower(lower(left.high, centre.high), right.high));
  store_pixels(d == INVALID ? INVALID : middle, filtered, x, width);
}

AT_EDGE void filter_block_at_edge(const int x, const int has_above, const int has_below, const int width,
                                  const int stride, global const float* here, global float* filtered) {
  filter_block(x, width, has_above, has_below, stride, here, filtered);
}

COMPILED_ONCE void filter_row(const WorkItem at, const ImageSize size, const int row_step,
                              global const float* disparity, global float* filtered) {
  if (!has_row(at, row_step)) return;
  const int stride = row_step * size.width;
  const int width = size.width, has_above = at.y >= row_step, has_below = at.y + row_step < size.height;
  const size_t row = ((size_t)at.view * size.height + at.y) * width;
  FOR_PIXELS(x, width) {
    if (has_above && has_below && is_within(x, 1, width)) {
      filter_block(x, EVERYWHERE, 1, 1, stride, disparity + row, filtered + row);
    } else {
      filter_block_at_edge(x, has_above, has_below, width, stride, disparity + row, filtered + row);
    }
  }
}

KERNEL void filter(const ImageSize size, const int row_step, global const float* disparity, global float* filtered) {
  filter_row(THIS_WORK_ITEM, size, row_step, disparity, filtered);
}
