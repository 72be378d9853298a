// SPDX-License-Identifier: Apache-2.0
// The images that are matched at a quarter of the resolution: sums of EGOSGM_COARSE x EGOSGM_COARSE pixels, those
// outside the image being its border's. Of 8-bit grey values the sum (times 16), of 16-bit ones the mean: 16 bits both.
#include "grey.h"

// lint: PIXEL_BYTES=1 PIXELS=1
// lint: PIXEL_BYTES=2 PIXELS=16

#ifndef PIXELS
#error "PIXELS: of a work-item, 1 or 16, and so 1 or 4 coarse ones"
#endif
#define AT_ONCE (PIXELS == 1 ? 1 : 4)

#if PIXEL_BYTES == 1
typedef ushort16 ColumnSums;
typedef ushort4 Means;
#define convert_sums convert_ushort16
#define to_16_bit(sum) ((sum) << 4)
#else
typedef uint16 ColumnSums;
typedef uint4 Means;
#define convert_sums convert_uint16
#define to_16_bit(sum) ((sum) >> 4)
#endif

// A work-item AT_ONCE neighbouring coarse pixels and view.
KERNEL void shrink(const ImageSize size, global const uchar* images, global uchar* coarse_images) {
  const ImageSize coarse = coarse_size(size);
  const int x = AT_ONCE * get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= coarse.width) return;

  global const Pixel* image = (global const Pixel*)images + (size_t)view * size.height * size.width;
  global ushort* to = (global ushort*)coarse_images + ((size_t)view * coarse.height + y) * coarse.width;
#if PIXELS > 1
  if ((x + AT_ONCE) * EGOSGM_COARSE <= size.width) {
    ColumnSums columns = 0;
    for (int v = 0; v < EGOSGM_COARSE; ++v) {
      const size_t row = min(y * EGOSGM_COARSE + v, size.height - 1);
      columns += convert_sums(load_grey(image + row * size.width + x * EGOSGM_COARSE));
    }
    const Means sums = columns.s048c + columns.s159d + columns.s26ae + columns.s37bf;
    vstore4(convert_ushort4(to_16_bit(sums)), 0, to + x);
    return;
  }
#endif
  for (int u = x; u < min(x + AT_ONCE, coarse.width); ++u) {
    uint sum = 0;
    for (int v = 0; v < EGOSGM_COARSE; ++v) {
      global const Pixel* row = image + (size_t)min(y * EGOSGM_COARSE + v, size.height - 1) * size.width;
      for (int w = 0; w < EGOSGM_COARSE; ++w) sum += row[min(u * EGOSGM_COARSE + w, size.width - 1)];
    }
    to[u] = (ushort)to_16_bit(sum);
  }
}
