// SPDX-License-Identifier: Apache-2.0
// What contradicts a static world, of the left view: pixels around which prediction and measurement differ.
#include "method.h"
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Ints has_both(const Floats predicted, const Floats measured) {
  return (predicted > INVALID) & (measured > INVALID);
}

// Of 2 EGOSGM_DYNAMIC_RADIUS + 1 pixels of the row: how many have both, and how many of those differ.
COMPILED_ONCE void count_rows_row(const WorkItem at, const ImageSize size, const float min_difference,
                                  global const float* predicted, global const float* measured, global float* both,
                                  global float* different) {
  const int width = size.width;
  const size_t row = (size_t)at.y * width;
  FOR_PIXELS(x, width) {
    Floats with_both = 0.0f;
    Floats that_differ = 0.0f;
    for (int u = -EGOSGM_DYNAMIC_RADIUS; u <= EGOSGM_DYNAMIC_RADIUS; ++u) {
      const Floats d = load_pixels(predicted + row, x + u, width);
      const Floats z = load_pixels(measured + row, x + u, width);
      const Ints counts = has_both(d, z);
      with_both += one_where(counts);
      that_differ += one_where(counts & (fabs(z - d) > min_difference));
    }
    store_pixels(with_both, both + row, x, width);
    store_pixels(that_differ, different + row, x, width);
  }
}

KERNEL void count_rows(const ImageSize size, const float min_difference, global const float* predicted,
                       global const float* measured, global float* both, global float* different) {
  count_rows_row(THIS_WORK_ITEM, size, min_difference, predicted, measured, both, different);
}

// 255 where at least half of the window's pixels that have both differ, if enough have.
COMPILED_ONCE void mark_row(const WorkItem at, const ImageSize size, global const float* predicted,
                            global const float* measured, global const float* both, global const float* different,
                            global uchar* marks) {
  const int y = at.y;
  const int width = size.width;
  const size_t row = (size_t)y * width;
  FOR_PIXELS(x, width) {
    Floats with_both = 0.0f;
    Floats that_differ = 0.0f;
    const int end = min(y + EGOSGM_DYNAMIC_RADIUS, size.height - 1);
    for (int v = max(y - EGOSGM_DYNAMIC_RADIUS, 0); v <= end; ++v) {
      with_both += load_pixels(both + (size_t)v * width, x, width);
      that_differ += load_pixels(different + (size_t)v * width, x, width);
    }
    const Ints here = has_both(load_pixels(predicted + row, x, width), load_pixels(measured + row, x, width));
    const Floats enough = EGOSGM_DYNAMIC_MIN_COUNT;
    const Ints marked = here & (with_both >= enough) & (that_differ + that_differ >= with_both);
    store_bytes(marked ? (Ints)(255) : (Ints)(0), marks + row, x, width);
  }
}

KERNEL void mark(const ImageSize size, global const float* predicted, global const float* measured,
                 global const float* both, global const float* different, global uchar* marks) {
  mark_row(THIS_WORK_ITEM, size, predicted, measured, both, different, marks);
}
