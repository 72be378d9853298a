// SPDX-License-Identifier: Apache-2.0
// The median of 3x3 disparities, in both views. A neighbour outside the image or without a value votes for the centre.
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

static inline float vote(const float neighbour, const float centre) {
  return neighbour > EGOSGM_INVALID_DISPARITY ? neighbour : centre;
}

kernel void filter(const ImageSize size, global const float* disparity, global float* filtered) {
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
  const Sorted left =
      sort(vote(has_above && has_left ? disparity[above - 1] : none, d), vote(has_left ? disparity[i - 1] : none, d),
           vote(has_below && has_left ? disparity[below - 1] : none, d));
  const Sorted centre =
      sort(vote(has_above ? disparity[above] : none, d), d, vote(has_below ? disparity[below] : none, d));
  const Sorted right =
      sort(vote(has_above && has_right ? disparity[above + 1] : none, d), vote(has_right ? disparity[i + 1] : none, d),
           vote(has_below && has_right ? disparity[below + 1] : none, d));
  // The median of nine is the median of: the largest of the columns' lowest, the median of their medians, the smallest
  // of their highest.
  const float middle =
      median(upper(upper(left.low, centre.low), right.low), median(left.middle, centre.middle, right.middle),
             lower(lower(left.high, centre.high), right.high));
  filtered[i] = d > none ? middle : none;
}
