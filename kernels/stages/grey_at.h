// SPDX-License-Identifier: Apache-2.0
// Grey values of a block of pixels, on the 8-bit scale. OpenCL C only.
#ifndef EGOSGM_KERNELS_GREY_AT_H
#define EGOSGM_KERNELS_GREY_AT_H

#include "grey.h"
#include "pixels.h"

#if PIXELS > 1
AT_EDGE Shorts grey_at_edge(global const Pixel* row, const int x, const int width) {
  const Ints inside = clamp(x + LANE_INDICES, (Ints)(0), (Ints)(width - 1));
  const Pixels pixels = GATHERED(Pixels, row, inside);
  return convert_short16(to_8_bit(pixels));
}
#endif

// Grey values of pixels x .. x + PIXELS - 1; outside the row its border's.
static inline Shorts grey_at(global const Pixel* row, const int x, const int width) {
#if PIXELS == 1
  return to_8_bit(row[clamp(x, 0, width - 1)]);
#else
  if (is_within(x, 0, width)) return convert_short16(to_8_bit(load_grey(row + x)));
  return grey_at_edge(row, x, width);
#endif
}

#endif
