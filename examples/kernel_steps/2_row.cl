// SPDX-License-Identifier: Apache-2.0
// A work-item a row: a CPU deals out few large pieces of work.
uchar penalty(const int most, const int least, const int slope, const int p, const int q) {
  return max(most - slope * max(p - q, q - p), least);
}

kernel void penalties(const int width, const int height, const int most, const int least, const int slope,
                      global const uchar* images, global uchar* steps) {
  const int y = get_global_id(1), view = get_global_id(2);
  global const uchar* image = images + view * width * height;
  const int above = max(y - 1, 0);
  for (int x = 0; x < width; ++x) {
    const int left = max(x - 1, 0), right = min(x + 1, width - 1);
    const int here = image[y * width + x];
    global uchar* to = steps + 4 * ((view * height + y) * width + x);
    to[0] = penalty(most, least, slope, here, image[y * width + left]);
    to[1] = penalty(most, least, slope, here, image[above * width + x]);
    to[2] = penalty(most, least, slope, here, image[above * width + left]);
    to[3] = penalty(most, least, slope, here, image[above * width + right]);
  }
}
