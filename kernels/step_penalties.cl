// SPDX-License-Identifier: Apache-2.0
// The penalty P2 of a disparity jump between two neighbouring pixels, lower where the image has an edge between them,
// since that is where surfaces end (Hirschmueller 2008, section 2.3): P2(p, q) = max(least, most - slope |I(p) -
// I(q)|), grey values of 8 bits.
//
// Four planes of a byte a pixel and view: the steps to the left, to above, to the upper left and to the upper right
// neighbour.
//
// lint: PIXEL_BYTES=1
// lint: PIXEL_BYTES=2
#include "shared.h"

#ifndef PIXEL_BYTES
#error "PIXEL_BYTES: 1 or 2, the size of a grey value"
#endif

#if PIXEL_BYTES == 1
typedef uchar Pixel;
#define to_8_bit(value) (value)
#else
typedef ushort Pixel;
#define to_8_bit(value) ((value) >> 8)
#endif

static inline uchar penalty(const int most, const int least, const int slope, const int p, const int q) {
  const int lowered = most - slope * (p > q ? p - q : q - p);
  return (uchar)(lowered < least ? least : lowered);
}

kernel void penalties(const ImageSize size, const int most, const int least, const int slope,
                      global const uchar* images, global uchar* planes) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + y) * size.width + x;
  const size_t plane = 2 * (size_t)size.height * size.width;
  global const Pixel* image = (global const Pixel*)images;
  // Outside the image there is no step: the pixel itself stands in.
  const size_t up = y > 0 ? size.width : 0;
  const size_t left = x > 0 ? 1 : 0;
  const size_t right = x + 1 < size.width ? 1 : 0;
  const int here = to_8_bit(image[i]);
  planes[i] = penalty(most, least, slope, here, to_8_bit(image[i - left]));
  planes[plane + i] = penalty(most, least, slope, here, to_8_bit(image[i - up]));
  planes[2 * plane + i] = penalty(most, least, slope, here, to_8_bit(image[i - up - left]));
  planes[3 * plane + i] = penalty(most, least, slope, here, to_8_bit(image[i - up + right]));
}
