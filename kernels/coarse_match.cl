// SPDX-License-Identifier: Apache-2.0
// The images that are matched at a quarter of the resolution: sums of EGOSGM_COARSE x EGOSGM_COARSE pixels, those
// outside the image being its border's. Of 8-bit grey values the sum (times 16), of 16-bit ones the mean: 16 bits both.
#include "grey.h"

// lint: PIXEL_BYTES=1
// lint: PIXEL_BYTES=2

#if PIXEL_BYTES == 1
#define to_16_bit(sum) ((sum) << 4)
#else
#define to_16_bit(sum) ((sum) >> 4)
#endif

// A work-item a coarse pixel and view.
kernel void shrink(const ImageSize size, global const uchar* images, global uchar* coarse_images) {
  const int coarse_width = (size.width + EGOSGM_COARSE - 1) / EGOSGM_COARSE;
  const int coarse_height = (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE;
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= coarse_width) return;

  global const Pixel* image = (global const Pixel*)images + (size_t)view * size.height * size.width;
  uint sum = 0;
  for (int v = 0; v < EGOSGM_COARSE; ++v) {
    global const Pixel* row = image + (size_t)min(y * EGOSGM_COARSE + v, size.height - 1) * size.width;
    for (int u = 0; u < EGOSGM_COARSE; ++u) sum += row[min(x * EGOSGM_COARSE + u, size.width - 1)];
  }
  ((global ushort*)coarse_images)[((size_t)view * coarse_height + y) * coarse_width + x] = (ushort)to_16_bit(sum);
}
