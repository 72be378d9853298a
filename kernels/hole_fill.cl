// SPDX-License-Identifier: Apache-2.0
// Hole fill (eqs. 7-8): gaps of a pixel between horizontal neighbours that differ by less than gamma, then, on that
// result, between vertical ones. Each work-item fills the three pixels of its column that it needs, so one pass does
// both.
#include "shared.h"

static inline int is_valid(const float disparity) { return disparity > EGOSGM_INVALID_DISPARITY; }

static inline int is_gap(const float centre, const float before, const float after, const float gamma) {
  return (centre <= EGOSGM_INVALID_DISPARITY) & is_valid(before) & is_valid(after) & (fabs(before - after) < gamma);
}

static inline float mean_of(const float a, const float b) { return 0.5f * (a + b); }
static inline float larger_of(const float a, const float b) { return a > b ? a : b; }

kernel void fill_rows(const ImageSize size, const float gamma, global const float* disparity,
                      global const float* variance, global float* filled_disparity, global float* filled_variance) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * size.width + x;
  const int has_left = x >= 1;
  const int has_right = x + 1 < size.width;

  const float left = has_left ? disparity[i - 1] : EGOSGM_INVALID_DISPARITY;
  const float right = has_right ? disparity[i + 1] : EGOSGM_INVALID_DISPARITY;
  const float left_variance = has_left ? variance[i - 1] : 0.0f;
  const float right_variance = has_right ? variance[i + 1] : 0.0f;
  const int fills = is_gap(disparity[i], left, right, gamma);
  filled_disparity[i] = fills ? mean_of(left, right) : disparity[i];
  filled_variance[i] = fills ? larger_of(left_variance, right_variance) : variance[i];
}

kernel void fill_columns(const ImageSize size, const float gamma, global const float* disparity,
                         global const float* variance, global float* filled_disparity, global float* filled_variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + y) * size.width + x;
  const size_t above = y >= 1 ? i - size.width : i;  // at the border the pixel itself, which is valid or no neighbour
  const size_t below = y + 1 < size.height ? i + size.width : i;

  const int fills = is_gap(disparity[i], disparity[above], disparity[below], gamma);
  filled_disparity[i] = fills ? mean_of(disparity[above], disparity[below]) : disparity[i];
  filled_variance[i] = fills ? larger_of(variance[above], variance[below]) : variance[i];
}
