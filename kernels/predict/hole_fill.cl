// SPDX-License-Identifier: Apache-2.0
// Hole fill (eqs. 7-8): gaps of a pixel between horizontal neighbours that differ by less than gamma, then, on that
// result, between vertical ones. Between hidden neighbours (ForwardWarp), a pixel is hidden too. Bytes of `hidden`: 1.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Ints is_gap(const Floats centre, const Floats before, const Floats after, const float gamma) {
  return (centre <= INVALID) & (before > INVALID) & (after > INVALID) & (fabs(before - after) < gamma);
}

static inline Floats middle_of(const Floats a, const Floats b) { return 0.5f * (a + b); }
static inline Floats larger_of(const Floats a, const Floats b) { return a > b ? a : b; }

// Where a pixel is filled: `mean` and `most`; where it is hidden: nothing; else d and p.
static inline void store_filled(const Ints fills, const Floats mean, const Floats most, const Ints hides,
                                const Floats d, const Floats p, global float* disparity, global float* variance,
                                global uchar* hidden, const int x, const int width) {
  const Ints is_hidden = fills ? (Ints)(0) : hides;
  const Floats zero = 0.0f;
  store_pixels(fills ? mean : is_hidden != 0 ? INVALID : d, disparity, x, width);
  store_pixels(fills ? most : is_hidden != 0 ? zero : p, variance, x, width);
  store_bytes(is_hidden, hidden, x, width);
}

// `whole_views`: those of which more than disparities is filled.
COMPILED_ONCE void fill_rows_row(const WorkItem at, const ImageSize size, const float gamma, const int whole_views,
                                 global const float* disparity, global const float* variance,
                                 global const uchar* hidden, global float* filled_disparity,
                                 global float* filled_variance, global uchar* still_hidden) {
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + at.y) * width;
  const bool is_whole = at.view < whole_views;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats left = load_pixels(disparity + row, x - 1, width);
    const Floats right = load_pixels(disparity + row, x + 1, width);
    const Ints fills = is_gap(d, left, right, gamma);
    if (!is_whole) {
      store_pixels(fills ? middle_of(left, right) : d, filled_disparity + row, x, width);
      continue;
    }
    const Floats p = load_pixels(variance + row, x, width);
    const Floats p_around =
        larger_of(load_pixels(variance + row, x - 1, width), load_pixels(variance + row, x + 1, width));
    const Ints is_between = load_bytes(hidden + row, x - 1, width) & load_bytes(hidden + row, x + 1, width);
    const Ints hides = is_between | load_bytes(hidden + row, x, width);
    store_filled(fills, middle_of(left, right), p_around, hides, d, p, filled_disparity + row, filled_variance + row,
                 still_hidden + row, x, width);
  }
}

KERNEL void fill_rows(const ImageSize size, const float gamma, const int whole_views, global const float* disparity,
                      global const float* variance, global const uchar* hidden, global float* filled_disparity,
                      global float* filled_variance, global uchar* still_hidden) {
  fill_rows_row(THIS_WORK_ITEM, size, gamma, whole_views, disparity, variance, hidden, filled_disparity,
                filled_variance, still_hidden);
}

COMPILED_ONCE void fill_columns_row(const WorkItem at, const ImageSize size, const float gamma, const int whole_views,
                                    global const float* disparity, global const float* variance,
                                    global const uchar* hidden, global float* filled_disparity,
                                    global float* filled_variance, global uchar* still_hidden) {
  const int y = at.y;
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + y) * width;
  // At the border the row itself, whose pixels are valid or no neighbours.
  const size_t row_above = y >= 1 ? row - width : row;
  const size_t row_below = y + 1 < size.height ? row + width : row;
  const bool is_whole = at.view < whole_views;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats above = load_pixels(disparity + row_above, x, width);
    const Floats below = load_pixels(disparity + row_below, x, width);
    const Ints fills = is_gap(d, above, below, gamma);
    if (!is_whole) {
      store_pixels(fills ? middle_of(above, below) : d, filled_disparity + row, x, width);
      continue;
    }
    const Floats p = load_pixels(variance + row, x, width);
    const Floats p_around =
        larger_of(load_pixels(variance + row_above, x, width), load_pixels(variance + row_below, x, width));
    const Ints is_between = load_bytes(hidden + row_above, x, width) & load_bytes(hidden + row_below, x, width);
    const Ints hides = is_between | load_bytes(hidden + row, x, width);
    store_filled(fills, middle_of(above, below), p_around, hides, d, p, filled_disparity + row, filled_variance + row,
                 still_hidden + row, x, width);
  }
}

KERNEL void fill_columns(const ImageSize size, const float gamma, const int whole_views, global const float* disparity,
                         global const float* variance, global const uchar* hidden, global float* filled_disparity,
                         global float* filled_variance, global uchar* still_hidden) {
  fill_columns_row(THIS_WORK_ITEM, size, gamma, whole_views, disparity, variance, hidden, filled_disparity,
                   filled_variance, still_hidden);
}
