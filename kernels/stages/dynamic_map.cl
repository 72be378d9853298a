// SPDX-License-Identifier: Apache-2.0
// Finds what contradicts a static world, in the left view: pixels around which prediction and measurement differ.
#include "method.h"
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Ints has_both(const Floats predicted, const Floats measured) {
  return (predicted > INVALID) & (measured > INVALID);
}

// 255 where at least half of the window's pixels that have both differ, if enough have.
COMPILED_ONCE void mark_row(const WorkItem at, const ImageSize size, global const float* predicted,
                            global const float* measured, global uchar* marks) {
  const int y = at.y;
  const int width = size.width;
  const size_t own = (size_t)y * width;
  const Floats most = EGOSGM_DIFFERENCE_PX;
  FOR_PIXELS(x, width) {
    const Ints here = has_both(load_pixels(predicted + own, x, width), load_pixels(measured + own, x, width));
    Floats with_both = 0.0f;
    Floats that_differ = 0.0f;
    for (int v = y - EGOSGM_DYNAMIC_RADIUS; v <= y + EGOSGM_DYNAMIC_RADIUS; v += EGOSGM_DYNAMIC_STEP) {
      if (v < 0 || v >= size.height) continue;
      const size_t row = (size_t)v * width;
      for (int u = x - EGOSGM_DYNAMIC_RADIUS; u <= x + EGOSGM_DYNAMIC_RADIUS; u += EGOSGM_DYNAMIC_STEP) {
        const Floats d = load_pixels(predicted + row, u, width);
        const Floats z = load_pixels(measured + row, u, width);
        const Ints counts = has_both(d, z);
        with_both += one_where(counts);
        that_differ += one_where(counts & (fabs(z - d) > most));
      }
    }
    const Floats enough = EGOSGM_DYNAMIC_MIN_COUNT;
    const Ints marked = here & (with_both >= enough) & (that_differ + that_differ >= with_both);
    store_bytes(marked ? (Ints)(255) : (Ints)(0), marks + own, x, width);
  }
}

KERNEL void mark(const ImageSize size, global const float* predicted, global const float* measured,
                 global uchar* marks) {
  mark_row(THIS_WORK_ITEM, size, predicted, measured, marks);
}
