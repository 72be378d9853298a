// SPDX-License-Identifier: Apache-2.0
// Census transform (Zabih and Woodfill 1994): a bit for every pixel of the window around the centre, row by row, set where that pixel
// is darker. Pixels outside the image are those of its border.
//
// A view's codes lie in rows of `stride` = padding + width + padding, the right view's from right to left, so that the codes a pixel is
// compared with at growing disparities lie at growing addresses in both views. The padding repeats the border's codes.
#include "shared.h"

#ifndef PIXEL_BYTES
#error "PIXEL_BYTES: 1 or 2, the size of a grey value"
#endif
#ifndef RADIUS_X
#error "RADIUS_X: half the window's width"
#endif
#ifndef RADIUS_Y
#error "RADIUS_Y: half the window's height"
#endif

#if PIXEL_BYTES == 1
typedef uchar Pixel;
typedef uchar16 Pixels;
#else
typedef ushort Pixel;
typedef ushort16 Pixels;
#endif

inline ulong code_at(const ImageSize size, global const Pixel* image, const int x, const int y) {
  const Pixel centre = image[(size_t)y * size.width + x];
  ulong code = 0;
  for (int dy = -RADIUS_Y; dy <= RADIUS_Y; ++dy) {
    global const Pixel* row = image + (size_t)clamp(y + dy, 0, size.height - 1) * size.width;
    for (int dx = -RADIUS_X; dx <= RADIUS_X; ++dx) {
      if (dx == 0 && dy == 0) continue;
      code = code << 1 | (row[clamp(x + dx, 0, size.width - 1)] < centre ? 1 : 0);
    }
  }
  return code;
}

// 16 pixels at once, where no column needs clamping.
inline ulong16 codes_at(const ImageSize size, global const Pixel* image, const int x, const int y) {
  const Pixels centre = vload16(0, image + (size_t)y * size.width + x);
  ulong16 codes = 0;
#pragma unroll
  for (int dy = -RADIUS_Y; dy <= RADIUS_Y; ++dy) {
    global const Pixel* row = image + (size_t)clamp(y + dy, 0, size.height - 1) * size.width + x;
#pragma unroll
    for (int dx = -RADIUS_X; dx <= RADIUS_X; ++dx) {
      if (dx == 0 && dy == 0) continue;
      codes = (codes << (ulong16)(1)) |
              (convert_ulong16(vload16(0, row + dx) < centre) & (ulong16)(1));
    }
  }
  return codes;
}

// A work-item a row and view.
kernel void census(const ImageSize size, const int padding, global const uchar* images, global ulong* codes) {
  const int y = get_global_id(0);
  const int view = get_global_id(1);
  if (y >= size.height) return;

  const int width = size.width;
  const size_t stride = (size_t)width + 2 * (size_t)padding;
  global const Pixel* image = (global const Pixel*)images + (size_t)view * size.height * width;
  global ulong* row = codes + ((size_t)view * size.height + y) * stride + padding;

  int x = 0;
  while (x < width) {
    const bool inside = x >= RADIUS_X && x + 15 + RADIUS_X < width;
    if (inside && view == EGOSGM_LEFT) vstore16(codes_at(size, image, x, y), 0, row + x);
    if (inside && view == EGOSGM_RIGHT) vstore16(codes_at(size, image, x, y).sfedcba9876543210, 0, row + width - 16 - x);
    if (!inside) row[view == EGOSGM_LEFT ? x : width - 1 - x] = code_at(size, image, x, y);
    x += inside ? 16 : 1;
  }
  for (int i = 1; i <= padding; ++i) {
    row[-i] = row[0];
    row[width - 1 + i] = row[width - 1];
  }
}
