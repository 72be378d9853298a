// SPDX-License-Identifier: Apache-2.0
// Edge rejection: drops a disparity whose nearest valid neighbour among the next two pixels to the left, right, above
// or below, of the rows that the view has, differs by more than max_jump. Both sides of a jump see each other, so both
// go.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Ints is_jump(const Floats d, const Floats near, const Floats far, const float max_jump) {
  const Floats neighbour = near > INVALID ? near : far;
  return (neighbour > INVALID) & (fabs(neighbour - d) > max_jump);
}

COMPILED_ONCE void reject_row(const WorkItem at, const ImageSize size, const int row_step, const float max_jump,
                              global const float* disparity, global float* kept) {
  if (!has_row(at, row_step)) return;
  const int y = at.y;
  const int width = size.width, stride = row_step * width;
  const size_t row = ((size_t)at.view * size.height + y) * width;
  global const float* here = disparity + row;
  // Above and below the image, the pixel itself is read, which is no jump.
  global const float* above = here - (y >= row_step ? stride : 0);
  global const float* far_above = above - (y >= 2 * row_step ? stride : 0);
  global const float* below = here + (y + row_step < size.height ? stride : 0);
  global const float* far_below = below + (y + 2 * row_step < size.height ? stride : 0);

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(here, x, width);
    const Ints jumps = is_jump(d, load_pixels(here, x - 1, width), load_pixels(here, x - 2, width), max_jump) |
                       is_jump(d, load_pixels(here, x + 1, width), load_pixels(here, x + 2, width), max_jump) |
                       is_jump(d, load_pixels(above, x, width), load_pixels(far_above, x, width), max_jump) |
                       is_jump(d, load_pixels(below, x, width), load_pixels(far_below, x, width), max_jump);
    store_pixels(jumps ? INVALID : d, kept + row, x, width);
  }
}

KERNEL void reject(const ImageSize size, const int row_step, const float max_jump, global const float* disparity,
                   global float* kept) {
  reject_row(THIS_WORK_ITEM, size, row_step, max_jump, disparity, kept);
}
