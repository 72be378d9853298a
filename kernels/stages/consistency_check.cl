// SPDX-License-Identifier: Apache-2.0
// Left-right consistency: the left pixel x sees what the right pixel x - d sees, the right pixel x what the left pixel
// x + d sees.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

COMPILED_ONCE void check_row(const WorkItem at, const ImageSize size, const int row_step, const float max_difference,
                             const int keep_outside, global const float* disparity, global float* kept) {
  if (!has_row(at, row_step)) return;
  const int y = at.y;
  const int view = at.view;
  const int width = size.width;
  const size_t row = ((size_t)view * size.height + y) * width;
  global const float* other_row = disparity + ((size_t)(1 - view) * size.height + y) * width;

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
      const Floats other = gather(other_row, &places[i]);
      const Ints agrees = is_valid(other) & (fabs(other - d) <= max_difference);
      const Ints keeps = is_inside[i] ? agrees : is_valid(d) & ((Ints)(keep_outside) != 0);
      store_pixels(keeps ? d : INVALID, kept + row, x, width);
    }
  }
}

KERNEL void check(const ImageSize size, const int row_step, const float max_difference, const int keep_outside,
                  global const float* disparity, global float* kept) {
  check_row(THIS_WORK_ITEM, size, row_step, max_difference, keep_outside, disparity, kept);
}
