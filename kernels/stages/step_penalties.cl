// SPDX-License-Identifier: Apache-2.0
// The penalty P2 of a disparity jump between two neighbouring pixels, lower where the image has an edge between them,
// since that is where surfaces end (Hirschmueller 2008, section 2.3): P2(p, q) = max(least, most - slope |I(p) -
// I(q)|), grey values of 8 bits.
//
// Four bytes a pixel: the steps to the left, to above, to the upper left and to the upper right neighbour. They lie
// side by side, as what a sweep reads in the short rows of a tile should lie in few places.
#include "grey_at.h"

// lint: PIXEL_BYTES=1 PIXELS=1
// lint: PIXEL_BYTES=1 PIXELS=16
// lint: PIXEL_BYTES=2 PIXELS=1
// lint: PIXEL_BYTES=2 PIXELS=16

static inline Ints penalty(const Ints most, const Ints least, const Ints slope, const Ints p, const Ints q) {
  return max(most - slope * max(p - q, q - p), least);
}

COMPILED_ONCE void penalties_row(const WorkItem at, const ImageSize size, const int row_step, const int most,
                                 const int least, const int slope, global const uchar* images, global uchar* steps) {
  if (!has_row(at, row_step)) return;
  const int y = at.y;
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + y) * width;
  // Outside the image there is no step: the border's pixel stands in.
  global const Pixel* here = (global const Pixel*)images + row;
  global const Pixel* above = here - (y >= row_step ? row_step * width : 0);

  FOR_PIXELS(x, width) {
    const Ints grey = INTS_OF_SHORTS(grey_at(here, x, width));
    const Ints left = penalty(most, least, slope, grey, INTS_OF_SHORTS(grey_at(here, x - 1, width)));
    const Ints up = penalty(most, least, slope, grey, INTS_OF_SHORTS(grey_at(above, x, width)));
    const Ints upper_left = penalty(most, least, slope, grey, INTS_OF_SHORTS(grey_at(above, x - 1, width)));
    const Ints upper_right = penalty(most, least, slope, grey, INTS_OF_SHORTS(grey_at(above, x + 1, width)));
    store_words(left | up << 8 | upper_left << 16 | upper_right << 24, steps + 4 * row, x, width);
  }
}

KERNEL void penalties(const ImageSize size, const int row_step, const int most, const int least, const int slope,
                      global const uchar* images, global uchar* steps) {
  penalties_row(THIS_WORK_ITEM, size, row_step, most, least, slope, images, steps);
}
