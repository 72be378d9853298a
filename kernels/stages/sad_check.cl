// SPDX-License-Identifier: Apache-2.0
// Drops disparities whose 3x3 windows in the two images differ too much: mean absolute difference, on the 8-bit scale,
// of the pixels that lie in both images.
#include "grey.h"
#include "pixels.h"

// lint: PIXEL_BYTES=1 PIXELS=1
// lint: PIXEL_BYTES=1 PIXELS=16
// lint: PIXEL_BYTES=2 PIXELS=1
// lint: PIXEL_BYTES=2 PIXELS=16

#if PIXEL_BYTES == 1
#define STEPS_PER_GREY 1
#else
#define STEPS_PER_GREY 257
#endif

COMPILED_ONCE void check_greys_row(const WorkItem at, const ImageSize size, const float max_difference,
                                   global const uchar* images, global float* disparity) {
  const int y = at.y;
  const int view = at.view;
  const int width = size.width;
  const size_t pixels = (size_t)width * size.height;
  const size_t row = view * pixels + (size_t)y * width;
  global const Pixel* here = (global const Pixel*)images + row;
  global const Pixel* there = (global const Pixel*)images + (1 - view) * pixels + (size_t)y * width;
  const int top = y > 0 ? -1 : 0, bottom = y + 1 < size.height ? 1 : 0;
  const Ints zero = 0;
  const Ints last = width - 1;
  // A disparity that leads out of the image has no window; clamped, it converts safely.
  const Floats farthest = 2.0f * width;

  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats shift = min(max(view == EGOSGM_LEFT ? -d : d, -farthest), farthest);
    const Ints column = x + LANE_INDICES;
    const Ints match = column + INTS_OF_FLOATS(nearest(shift));
    Ints sum = 0;
    Ints count = 0;
    for (int u = -1; u <= 1; ++u) {
      const Ints own = min(max(column + u, zero), last), other = min(max(match + u, zero), last);
      const Ints is_in_both = (own == column + u) & (other == match + u);
      for (int v = top; v <= bottom; ++v) {
        const Ints own_grey = GATHERED(Ints, here + (long)v * width, own);
        const Ints other_grey = GATHERED(Ints, there + (long)v * width, other);
        sum += is_in_both ? max(own_grey - other_grey, other_grey - own_grey) : zero;
        count += is_in_both ? (Ints)(STEPS_PER_GREY) : zero;
      }
    }
    const Ints is_inside = (d > INVALID) & (match >= zero) & (match <= last);
    const Ints is_alike = FLOATS_OF_INTS(sum) <= (Floats)(max_difference)*FLOATS_OF_INTS(count);
    store_pixels((is_inside & is_alike) ? d : INVALID, disparity + row, x, width);
  }
}

KERNEL void check_greys(const ImageSize size, const float max_difference, global const uchar* images,
                        global float* disparity) {
  check_greys_row(THIS_WORK_ITEM, size, max_difference, images, disparity);
}
