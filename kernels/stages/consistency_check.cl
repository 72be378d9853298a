// SPDX-License-Identifier: Apache-2.0
// Left-right consistency: the left pixel x sees what the right pixel x - d sees, the right pixel x what the left pixel
// x + d sees. Where that view lacks a row, those above and below it are asked: one that agrees is enough.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Ints agrees(const Floats d, const Floats other, const float max_difference) {
  return is_valid(other) & (fabs(other - d) <= max_difference);
}

COMPILED_ONCE void check_row(const WorkItem at, const ImageSize size, const RowSteps row_steps,
                             const float max_difference, const int keep_outside, global const float* disparity,
                             global float* kept) {
  if (!has_row(at, row_steps)) return;
  const int y = at.y;
  const int view = at.view;
  const int width = size.width;
  const size_t row = ((size_t)view * size.height + y) * width;
  const int step = row_step_of(1 - view, row_steps), above = y - y % step, next = above + step;
  const int below = above < y && next < size.height ? next : above;
  const size_t other_view = (size_t)(1 - view) * size.height * width;
  global const float* other_above = disparity + other_view + (size_t)above * width;
  global const float* other_below = disparity + other_view + (size_t)below * width;

  FOR_CHUNKS(start, width) {
    Ints is_inside[CHUNK], places[CHUNK];
    FOR_BLOCKS(x, i, start, width) {
      const Floats d = load_pixels(disparity + row, x, width);
      const Floats zero = 0.0f;
      // Asked of the floats, with comparisons that NaN fails, before they become integers.
      const Floats at = nearest(FLOATS_OF_INTS(x + LANE_INDICES) + (view == EGOSGM_LEFT ? -d : d));
      const Ints inside = is_valid(d) & (at >= zero) & (at < (Floats)(width));
      is_inside[i] = inside;
      places[i] = INTS_OF_FLOATS(inside ? at : zero);
    }
    FOR_BLOCKS(x, i, start, width) {
      const Floats d = load_pixels(disparity + row, x, width);
      Ints agree = agrees(d, gather(other_above, &places[i]), max_difference);
      if (below != above) agree |= agrees(d, gather(other_below, &places[i]), max_difference);
      const Ints keeps = is_inside[i] ? agree : is_valid(d) & ((Ints)(keep_outside) != 0);
      store_pixels(keeps ? d : INVALID, kept + row, x, width);
    }
  }
}

KERNEL void check(const ImageSize size, const RowSteps row_steps, const float max_difference, const int keep_outside,
                  global const float* disparity, global float* kept) {
  check_row(THIS_WORK_ITEM, size, row_steps, max_difference, keep_outside, disparity, kept);
}
