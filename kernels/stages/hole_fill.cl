// SPDX-License-Identifier: Apache-2.0
// Hole fill (eqs. 7-8): gaps of a pixel between horizontal neighbours that differ by less than gamma, then, on that
// result, between vertical ones, the next ones that the view has. Between hidden neighbours (EGOSGM_HIDDEN), a pixel is
// hidden too.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Ints is_gap(const Floats centre, const Floats before, const Floats after, const float gamma) {
  return (centre <= INVALID) & (before > INVALID) & (after > INVALID) & (fabs(before - after) < gamma);
}

static inline Floats middle_of(const Floats a, const Floats b) { return 0.5f * (a + b); }
static inline Floats larger_of(const Floats a, const Floats b) { return a > b ? a : b; }

// By the variances: whether a pixel is hidden, unless it is filled.
static inline Ints is_hidden(const Floats p, const Floats before, const Floats after) {
  const Floats hidden = EGOSGM_HIDDEN;
  return (p == hidden) | ((before == hidden) & (after == hidden));
}

COMPILED_ONCE void fill_row(const WorkItem at, const ImageSize size, const int row_step, const float gamma,
                            global const float* disparity, global const float* variance, global float* filled_disparity,
                            global float* filled_variance) {
  if (!has_row(at, row_step)) return;
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + at.y) * width;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats left = load_pixels(disparity + row, x - 1, width);
    const Floats right = load_pixels(disparity + row, x + 1, width);
    const Ints fills = is_gap(d, left, right, gamma);
    const Floats p = load_pixels(variance + row, x, width);
    const Floats p_left = load_pixels(variance + row, x - 1, width);
    const Floats p_right = load_pixels(variance + row, x + 1, width);
    const Ints hides = is_hidden(p, p_left, p_right);
    store_pixels(fills ? middle_of(left, right) : hides ? INVALID : d, filled_disparity + row, x, width);
    store_pixels(fills   ? larger_of(p_left, p_right)
                 : hides ? (Floats)(EGOSGM_HIDDEN)
                         : p,
                 filled_variance + row, x, width);
  }
}

KERNEL void fill_rows(const ImageSize size, const int row_step, const float gamma, global const float* disparity,
                      global const float* variance, global float* filled_disparity, global float* filled_variance) {
  fill_row(THIS_WORK_ITEM, size, row_step, gamma, disparity, variance, filled_disparity, filled_variance);
}

// `hidden`: 1 where a pixel is.
COMPILED_ONCE void fill_columns_row(const WorkItem at, const ImageSize size, const int row_step, const float gamma,
                                    global const float* disparity, global const float* variance,
                                    global float* filled_disparity, global float* filled_variance,
                                    global uchar* hidden) {
  if (!has_row(at, row_step)) return;
  const int y = at.y;
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + y) * width;
  // At the border the row itself, whose pixels are valid or no neighbours.
  const size_t row_above = y >= row_step ? row - (size_t)row_step * width : row;
  const size_t row_below = y + row_step < size.height ? row + (size_t)row_step * width : row;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats above = load_pixels(disparity + row_above, x, width);
    const Floats below = load_pixels(disparity + row_below, x, width);
    const Ints fills = is_gap(d, above, below, gamma);
    const Floats p = load_pixels(variance + row, x, width);
    const Floats p_above = load_pixels(variance + row_above, x, width);
    const Floats p_below = load_pixels(variance + row_below, x, width);
    const Ints hides = fills ? (Ints)(0) : is_hidden(p, p_above, p_below);
    store_pixels(fills ? middle_of(above, below) : hides ? INVALID : d, filled_disparity + row, x, width);
    store_pixels(fills ? larger_of(p_above, p_below) : p, filled_variance + row, x, width);
    store_bytes(hides & (Ints)(1), hidden + row, x, width);
  }
}

KERNEL void fill_columns(const ImageSize size, const int row_step, const float gamma, global const float* disparity,
                         global const float* variance, global float* filled_disparity, global float* filled_variance,
                         global uchar* hidden) {
  fill_columns_row(THIS_WORK_ITEM, size, row_step, gamma, disparity, variance, filled_disparity, filled_variance,
                   hidden);
}
