// SPDX-License-Identifier: Apache-2.0
// Variance beside a disparity jump: with a small probability w the pixel belongs to another surface of its window,
// whose disparities reach from l to h, so that its variance is at least w (h - l)^2.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

// Least and largest valid disparity of 2 EGOSGM_EDGE_RADIUS + 1 pixels of the row; none: INVALID as the largest.
kernel void row_extremes(const ImageSize size, global const float* disparity, global float* least,
                         global float* largest) {
  const int width = size.width;
  const size_t row = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * width;
  FOR_PIXELS(x, width) {
    const Floats beyond = -EGOSGM_INVALID_DISPARITY;
    Floats low = beyond;
    Floats high = INVALID;
    for (int u = -EGOSGM_EDGE_RADIUS; u <= EGOSGM_EDGE_RADIUS; ++u) {
      const Floats d = load_pixels(disparity + row, x + u, width);
      const Floats valid_or_beyond = d > INVALID ? d : beyond;
      low = valid_or_beyond < low ? valid_or_beyond : low;
      high = d > high ? d : high;
    }
    store_pixels(low, least + row, x, width);
    store_pixels(high, largest + row, x, width);
  }
}

kernel void widen(const ImageSize size, const float weight, global const float* disparity, global const float* least,
                  global const float* largest, global float* variance) {
  const int y = get_global_id(1);
  const int width = size.width;
  const size_t view = (size_t)get_global_id(2) * size.height * width;
  const size_t row = view + (size_t)y * width;
  FOR_PIXELS(x, width) {
    Floats low = -EGOSGM_INVALID_DISPARITY;
    Floats high = INVALID;
    const int end = min(y + EGOSGM_EDGE_RADIUS, size.height - 1);
    for (int v = max(y - EGOSGM_EDGE_RADIUS, 0); v <= end; ++v) {
      const Floats row_low = load_pixels(least + view + (size_t)v * width, x, width);
      const Floats row_high = load_pixels(largest + view + (size_t)v * width, x, width);
      low = row_low < low ? row_low : low;
      high = row_high > high ? row_high : high;
    }
    const Floats range = high - low;
    const Floats least_variance = weight * (range * range);
    const Floats p = load_pixels(variance + row, x, width);
    const Ints widens = (load_pixels(disparity + row, x, width) > INVALID) & (least_variance > p);
    store_pixels(widens ? least_variance : p, variance + row, x, width);
  }
}
