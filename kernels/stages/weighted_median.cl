// SPDX-License-Identifier: Apache-2.0
// The weighted median of a pixel's disparity and those of eight pixels on a circle of 4 pixels around it, in both views
// (Ma, He, Wei, Sun, Wu: Constant time weighted median filtering for stereo matching and beyond, ICCV 2013). A vote
// weighs the more, the nearer the two grey values are, so that no surface spreads over its outline; a pixel that is
// EGOSGM_VOTE_GREYS brighter or darker has none, nor has one without a disparity or outside of the image. A pixel
// without a disparity takes the median of the others where EGOSGM_FILL_MIN_COUNT of them vote.
#include "grey_at.h"
#include "method.h"

// lint: PIXEL_BYTES=1 PIXELS=1
// lint: PIXEL_BYTES=1 PIXELS=16
// lint: PIXEL_BYTES=2 PIXELS=1
// lint: PIXEL_BYTES=2 PIXELS=16

#define VOTES 9

COMPILED_ONCE void weigh_row(const WorkItem at, const ImageSize size, const int row_step, global const uchar* images,
                             global const float* disparity, global float* filtered, global float* variance) {
  if (!has_row(at, row_step)) return;
  const int columns[VOTES] = {0, 0, -3, 3, -4, 4, -3, 3, 0}, rows[VOTES] = {0, -4, -2, -2, 0, 0, 2, 2, 4};
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + at.y) * width;
  global const Pixel* greys = (global const Pixel*)images + row;

  FOR_PIXELS(x, width) {
    const Ints grey = grey_at(greys, x, width);
    Floats votes[VOTES];
    Ints weights[VOTES], sums[VOTES], total = 0, voters = 0;
#pragma unroll
    for (int i = 0; i < VOTES; ++i) {
      const int column = x + columns[i], y = at.y + rows[i], is_inside = y >= 0 && y < size.height;
      const long other = is_inside ? (long)rows[i] * width : 0;
      const Ints difference = grey - grey_at(greys + other, column, width);
      const Ints alike = max((Ints)(EGOSGM_VOTE_GREYS)-max(difference, -difference), (Ints)(0));
      votes[i] = load_pixels(disparity + row + other, column, width);
      weights[i] = sums[i] = is_valid(votes[i]) ? (is_inside ? alike : (Ints)(0)) : (Ints)(0);
      total += weights[i];
      voters += min(weights[i], (Ints)(1));
    }
    // The weights of all votes that are no higher; of equal ones the first has them all.
#pragma unroll
    for (int i = 0; i < VOTES; ++i) {
#pragma unroll
      for (int j = i + 1; j < VOTES; ++j) {
        const Ints is_lower = votes[i] < votes[j];
        sums[i] += is_lower ? (Ints)(0) : weights[j];
        sums[j] += is_lower ? weights[i] : (Ints)(0);
      }
    }
    // The least vote that has half of the weights.
    const Ints half_of_total = (total + 1) >> 1;
    Floats middle = 1e30f;
#pragma unroll
    for (int i = 0; i < VOTES; ++i) {
      const Floats vote = sums[i] >= half_of_total ? votes[i] : (Floats)(1e30f);
      middle = vote < middle ? vote : middle;
    }
    const Ints is_hole = votes[0] == INVALID, is_filled = is_hole & (voters >= EGOSGM_FILL_MIN_COUNT);
    store_pixels((is_hole != is_filled) ? INVALID : middle, filtered + row, x, width);
    const Floats kept_variance = load_pixels(variance + row, x, width);
    store_pixels(is_filled ? (Floats)(EGOSGM_FILLED_VARIANCE_PX2) : kept_variance, variance + row, x, width);
  }
}

KERNEL void weigh(const ImageSize size, const int row_step, global const uchar* images, global const float* disparity,
                  global float* filtered, global float* variance) {
  weigh_row(THIS_WORK_ITEM, size, row_step, images, disparity, filtered, variance);
}
