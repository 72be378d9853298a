// SPDX-License-Identifier: Apache-2.0
// Sixteen pixels at once, as vectors that the compiler need not find. Where the row ends, they are gathered one by one.
int16 grey_at(global const uchar* row, const int x, const int width) {
  if (x >= 0 && x + 16 <= width) return convert_int16(vload16(0, row + x));
  int grey[16];
  for (int i = 0; i < 16; ++i) grey[i] = row[clamp(x + i, 0, width - 1)];
  return vload16(0, grey);
}

uchar16 penalty(const int most, const int least, const int slope, const int16 p, const int16 q) {
  return convert_uchar16(max((int16)(most)-slope * max(p - q, q - p), (int16)(least)));
}

kernel void penalties(const int width, const int height, const int most, const int least, const int slope,
                      global const uchar* images, global uchar* steps) {
  const int y = get_global_id(1), view = get_global_id(2);
  global const uchar* here = images + (view * height + y) * width;
  global const uchar* above = y > 0 ? here - width : here;
  for (int x = 0; x < width; x += 16) {
    const int16 grey = grey_at(here, x, width);
    uchar four[4][16];
    vstore16(penalty(most, least, slope, grey, grey_at(here, x - 1, width)), 0, four[0]);
    vstore16(penalty(most, least, slope, grey, grey_at(above, x, width)), 0, four[1]);
    vstore16(penalty(most, least, slope, grey, grey_at(above, x - 1, width)), 0, four[2]);
    vstore16(penalty(most, least, slope, grey, grey_at(above, x + 1, width)), 0, four[3]);
    for (int i = 0; i < 16 && x + i < width; ++i)
      for (int k = 0; k < 4; ++k) steps[4 * ((view * height + y) * width + x + i) + k] = four[k][i];
  }
}
