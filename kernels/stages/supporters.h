// SPDX-License-Identifier: Apache-2.0
// Whether a pixel stands alone on its surface, or within it. OpenCL C only.
#ifndef EGOSGM_KERNELS_SUPPORTERS_H
#define EGOSGM_KERNELS_SUPPORTERS_H

#include "method.h"
#include "pixels.h"

// Which pixels of `asked` have others on a grid around that differ from d by at most `most`: `enough` of them, or where
// there is `evidence`, confirmed ones to all four sides, but for those where the image ends. No row is asked once
// nothing lacks: that decides nearly everywhere.
static inline Ints have_supporters(const ImageSize size, const int x, const int y, const Ints asked, const Ints enough,
                                   const Floats d, const float most, global const float* disparity,
                                   global const uchar* evidence) {
  const Ints at = x + LANE_INDICES;
  Ints left = at < EGOSGM_SUPPORTERS_STEP, right = at >= size.width - EGOSGM_SUPPORTERS_STEP;
  Ints above = (Ints)(y < EGOSGM_SUPPORTERS_STEP ? -1 : 0);
  Ints below = (Ints)(y >= size.height - EGOSGM_SUPPORTERS_STEP ? -1 : 0);
  Ints supporters = 0, lacks = asked;
  // The pixel's own row comes first: most find what they need there.
  for (int i = 0; i <= 2 * EGOSGM_SUPPORTERS_RADIUS / EGOSGM_SUPPORTERS_STEP && any_of(lacks); ++i) {
    const int away = (i + 1) / 2 * EGOSGM_SUPPORTERS_STEP, v = i % 2 == 0 ? y + away : y - away;
    if (v < 0 || v >= size.height) continue;
    const size_t row = (size_t)v * size.width;
    Ints in_row = 0;
    for (int u = x - EGOSGM_SUPPORTERS_RADIUS; u <= x + EGOSGM_SUPPORTERS_RADIUS; u += EGOSGM_SUPPORTERS_STEP) {
      if (u == x && v == y) continue;
      const Floats other = load_pixels(disparity + row, u, size.width);
      Ints counts = is_valid(other) & (fabs(other - d) <= (Floats)(most));
      if (evidence) counts &= load_bytes(evidence + row, u, size.width) >= EGOSGM_EVIDENCE_CONFIRMED;
      supporters += counts ? (Ints)(1) : (Ints)(0);
      in_row |= counts;
      if (u < x) left |= counts;
      if (u > x) right |= counts;
    }
    if (v < y) above |= in_row;
    if (v > y) below |= in_row;
    lacks = asked & (evidence ? !(left & right & above & below) : supporters < enough);
  }
  return asked & !lacks;
}

#endif
