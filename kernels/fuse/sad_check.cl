// SPDX-License-Identifier: Apache-2.0
// Drops disparities whose 3x3 windows in the two images differ too much: mean absolute difference, on the 8-bit scale.
#include "grey.h"

// lint: PIXEL_BYTES=1
// lint: PIXEL_BYTES=2

#if PIXEL_BYTES == 1
#define STEPS_PER_GREY 1
#else
#define STEPS_PER_GREY 257
#endif

KERNEL void check(const ImageSize size, const float max_difference, global const uchar* images,
                  global float* disparity, global float* variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= size.width) return;

  const size_t pixels = (size_t)size.width * size.height;
  const size_t pixel = view * pixels + (size_t)y * size.width + x;
  const float d = disparity[pixel];
  // A disparity that leads out of the image has no window; clamped, it converts safely.
  const float shift = fmin(fmax(view == EGOSGM_LEFT ? -d : d, -2.0f * size.width), 2.0f * size.width);
  const int match = x + convert_int_rte(shift);
  global const Pixel* here = (global const Pixel*)images + view * pixels;
  global const Pixel* there = (global const Pixel*)images + (1 - view) * pixels;

  const int left = max(-1, -min(x, match));
  const int right = min(1, size.width - 1 - max(x, match));
  const int top = max(-1, -y);
  const int bottom = min(1, size.height - 1 - y);
  uint sum = 0;
  const bool inside = match >= 0 && match < size.width && d > EGOSGM_INVALID_DISPARITY;
  if (inside) {
    for (int v = top; v <= bottom; ++v) {
      const size_t row = (size_t)(y + v) * size.width;
      for (int u = left; u <= right; ++u) sum += abs((int)here[row + x + u] - (int)there[row + match + u]);
    }
  }
  const int count = (right - left + 1) * (bottom - top + 1) * STEPS_PER_GREY;
  const bool keeps = inside && sum <= max_difference * count;
  if (keeps) return;
  disparity[pixel] = EGOSGM_INVALID_DISPARITY;
  variance[pixel] = 0.0f;
}
