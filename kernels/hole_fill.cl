// SPDX-License-Identifier: Apache-2.0
// Hole fill (eqs. 7-8): gaps of a pixel between horizontal neighbours that differ by less than gamma, then, on that
// result, between vertical ones. Each work-item fills the three pixels of its column that it needs, so one pass does
// both.
#include "shared.h"

typedef struct {
  float disparity, variance;
} Estimate;

Estimate estimate_at(global const float* disparity, global const float* variance, const size_t i, const bool exists) {
  Estimate estimate;
  estimate.disparity = exists ? disparity[i] : EGOSGM_INVALID_DISPARITY;
  estimate.variance = exists ? variance[i] : 0.0f;
  return estimate;
}

Estimate fill_between(const Estimate centre, const Estimate before, const Estimate after, const float gamma) {
  const bool fills = !(centre.disparity > EGOSGM_INVALID_DISPARITY) && before.disparity > EGOSGM_INVALID_DISPARITY &&
                     after.disparity > EGOSGM_INVALID_DISPARITY && fabs(before.disparity - after.disparity) < gamma;
  Estimate filled;
  filled.disparity = fills ? 0.5f * (before.disparity + after.disparity) : centre.disparity;
  const float larger = before.variance > after.variance ? before.variance : after.variance;
  filled.variance = fills ? larger : centre.variance;
  return filled;
}

Estimate fill_in_row(const ImageSize size, const float gamma, global const float* disparity,
                     global const float* variance, const size_t i, const int x, const bool exists) {
  return fill_between(estimate_at(disparity, variance, i, exists),
                      estimate_at(disparity, variance, i - 1, exists && x >= 1),
                      estimate_at(disparity, variance, i + 1, exists && x + 1 < size.width), gamma);
}

kernel void fill(const ImageSize size, const float gamma, global const float* disparity, global const float* variance,
                 global float* filled_disparity, global float* filled_variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + y) * size.width + x;
  const size_t row = size.width;

  const Estimate above = fill_in_row(size, gamma, disparity, variance, i - row, x, y >= 1);
  const Estimate centre = fill_in_row(size, gamma, disparity, variance, i, x, true);
  const Estimate below = fill_in_row(size, gamma, disparity, variance, i + row, x, y + 1 < size.height);
  const Estimate filled = fill_between(centre, above, below, gamma);
  filled_disparity[i] = filled.disparity;
  filled_variance[i] = filled.variance;
}
