// SPDX-License-Identifier: Apache-2.0
// The four bytes of a pixel are a word, so that sixteen pixels are one store.
int16 grey_at(global const uchar* row, const int x, const int width) {
  if (x >= 0 && x + 16 <= width) return convert_int16(vload16(0, row + x));
  int grey[16];
  for (int i = 0; i < 16; ++i) grey[i] = row[clamp(x + i, 0, width - 1)];
  return vload16(0, grey);
}

int16 penalty(const int most, const int least, const int slope, const int16 p, const int16 q) {
  return max((int16)(most)-slope * max(p - q, q - p), (int16)(least));
}

void store_words(const int16 words, global int* row, const int x, const int width) {
  if (x + 16 <= width) {
    vstore16(words, 0, row + x);
    return;
  }
  int each[16];
  vstore16(words, 0, each);
  for (int i = 0; x + i < width; ++i) row[x + i] = each[i];
}

kernel void penalties(const int width, const int height, const int most, const int least, const int slope,
                      global const uchar* images, global uchar* steps) {
  const int y = get_global_id(1), view = get_global_id(2);
  global const uchar* here = images + (view * height + y) * width;
  global const uchar* above = y > 0 ? here - width : here;
  for (int x = 0; x < width; x += 16) {
    const int16 grey = grey_at(here, x, width);
    const int16 left = penalty(most, least, slope, grey, grey_at(here, x - 1, width));
    const int16 up = penalty(most, least, slope, grey, grey_at(above, x, width));
    const int16 upper_left = penalty(most, least, slope, grey, grey_at(above, x - 1, width));
    const int16 upper_right = penalty(most, least, slope, grey, grey_at(above, x + 1, width));
    store_words(left | up << 8 | upper_left << 16 | upper_right << 24, (global int*)steps + (view * height + y) * width,
                x, width);
  }
}
