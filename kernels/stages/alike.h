// SPDX-License-Identifier: Apache-2.0
// Which pixels of a census window are about as bright as its centre, for census.cl, which has Rows and the window.
// OpenCL C only.
#ifndef EGOSGM_KERNELS_ALIKE_H
#define EGOSGM_KERNELS_ALIKE_H

#include "code_bytes.h"

#define HAS_ALIKE (PIXEL_BYTES == 2 && COUNT == 62)
#if HAS_ALIKE
// Pixels side by side on a surface differ by its texture and by noise, and most of the eight around a pixel lie on its
// surface. So its tolerance follows from the fourth least difference to these. `least`: the four least, in order.
#define ADD_DIFFERENCE(Greys, least, difference)        \
  {                                                     \
    Greys other = difference;                           \
    for (int place = 0; place < 4; ++place) {           \
      const Greys greater = max(other, (least)[place]); \
      (least)[place] = min(other, (least)[place]);      \
      other = greater;                                  \
    }                                                   \
  }
#define TOLERANCE(Greys, least)                                                                      \
  add_sat((Greys)(min((least)[3], (Greys)(65535 / EGOSGM_ALIKE_TIMES)) * (Greys)EGOSGM_ALIKE_TIMES), \
          (Greys)EGOSGM_ALIKE_LEAST)

static inline Code alike_at(const int width, const Rows* rows, const int x) {
  Pixel least[4] = {65535, 65535, 65535, 65535};
#pragma unroll
  for (int i = 0; i < 9; ++i) {
    if (i != 4) ADD_DIFFERENCE(Pixel, least, abs_diff(AT(i % 3 - 1, i / 3 - 1), AT(0, 0)));
  }
  const Pixel tolerance = TOLERANCE(Pixel, least);
  Code code = 0;
#pragma unroll
  for (int i = 0; i < COUNT; ++i) code = code << 1 | (abs_diff(AT(DX(i), DY(i)), AT(0, 0)) <= tolerance ? 1 : 0);
  return code;
}

#if PIXELS > 1
static inline void write_alike_at(const Rows* rows, const int x, const int width, const int view, global Code* row) {
  const Greys centre = load_greys(rows->at[RADIUS_Y] + x), most = (Greys)((ushort)65535);
  Greys least[4] = {most, most, most, most};
#pragma unroll
  for (int i = 0; i < 9; ++i) {
    if (i != 4) ADD_DIFFERENCE(Greys, least, abs_diff(BESIDE(i % 3 - 1, i / 3 - 1), centre));
  }
  const Greys tolerance = TOLERANCE(Greys, least);
  Bytes bytes[CODE_BYTES];
#pragma unroll
  for (int byte = 0; byte < CODE_BYTES; ++byte) bytes[byte] = 0;
#pragma unroll
  for (int i = 0; i < COUNT; ++i) {
    const int place = COUNT - 1 - i;
    const Bytes others = bit_where_less(tolerance, abs_diff(BESIDE(DX(i), DY(i)), centre), 255);
    bytes[place / 8] |= ~others & (Bytes)((uchar)(1 << place % 8));
  }
  write_codes(JOINED_BYTES(WHOLE_BYTES, bytes), x, width, view, row);
}
#endif
#endif

#endif
