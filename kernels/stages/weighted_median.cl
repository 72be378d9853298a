// SPDX-License-Identifier: Apache-2.0
// The weighted median of a pixel's disparity and those of eight pixels on a circle of 4 pixels around it, in both views
// (Ma, He, Wei, Sun, Wu: Constant time weighted median filtering for stereo matching and beyond, ICCV 2013). A vote
// weighs the more, the nearer the two grey values are, so that no surface spreads over its outline; a pixel that is
// EGOSGM_VOTE_GREYS brighter or darker has none, nor has one without a disparity or outside of the image. A pixel
// without a disparity takes the median of the others where EGOSGM_FILL_MIN_COUNT of them vote. Votes are ordered by
// their places: disparities from the least of the range on, in steps that 15 bits can count over the whole range.
#include "grey_at.h"
#include "method.h"

// lint: PIXEL_BYTES=1 PIXELS=1
// lint: PIXEL_BYTES=1 PIXELS=16
// lint: PIXEL_BYTES=2 PIXELS=1
// lint: PIXEL_BYTES=2 PIXELS=16

#define VOTES 9

// Negative where there is no disparity.
static inline Shorts place_of(const Floats d, const float least, const float steps_per_px) {
  const Ints place = INTS_OF_FLOATS((d - least) * steps_per_px);
  return SHORTS_OF_INTS(clamp(place, (Ints)(SHRT_MIN), (Ints)(SHRT_MAX)));
}

COMPILED_ONCE void weigh_row(const WorkItem at, const ImageSize size, const int row_step, const float least,
                             const float steps_per_px, global const uchar* images, global const float* disparity,
                             global float* filtered, global float* variance) {
  if (!has_row(at, row_step)) return;
  const int columns[VOTES] = {0, 0, -3, 3, -4, 4, -3, 3, 0}, rows[VOTES] = {0, -4, -2, -2, 0, 0, 2, 2, 4};
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + at.y) * width;
  global const Pixel* greys = (global const Pixel*)images + row;

  FOR_PIXELS(x, width) {
    const Shorts grey = grey_at(greys, x, width), none = 0;
    Floats votes[VOTES];
    Shorts places[VOTES], weights[VOTES], sums[VOTES], total = 0, voters = 0;
#pragma unroll
    for (int i = 0; i < VOTES; ++i) {
      const int column = x + columns[i], y = at.y + rows[i], is_inside = y >= 0 && y < size.height;
      const long other = is_inside ? (long)rows[i] * width : 0;
      const Shorts difference = grey - grey_at(greys + other, column, width);
      const Shorts alike = (Shorts)(EGOSGM_VOTE_GREYS)-max(difference, (Shorts)(-difference));
      votes[i] = load_pixels(disparity + row + other, column, width);
      places[i] = place_of(votes[i], least, steps_per_px);
      weights[i] = sums[i] = places[i] >= none ? (is_inside ? max(alike, none) : none) : none;
      total += weights[i];
      voters += min(weights[i], (Shorts)(1));
    }
    // The weights of all votes that are no higher; of equal ones the first has them all.
#pragma unroll
    for (int i = 0; i < VOTES; ++i) {
#pragma unroll
      for (int j = 1; j < VOTES; ++j) {
        if (j <= i) continue;  // in a loop that begins at i, PoCL 3.1 keeps the arrays in memory
        sums[i] += places[i] < places[j] ? none : weights[j];
        sums[j] += places[i] < places[j] ? weights[i] : none;
      }
    }
    // The least vote that has half of the weights.
    const Shorts half_of_total = (total + (Shorts)(1)) >> (Shorts)(1);
    Shorts least_place = SHRT_MAX;
    Floats middle = INVALID;
#pragma unroll
    for (int i = 0; i < VOTES; ++i) {
      const Shorts is_less = (sums[i] >= half_of_total) & (weights[i] > none) & (places[i] < least_place);
      least_place = is_less ? places[i] : least_place;
      middle = INTS_OF_SHORTS(is_less) ? votes[i] : middle;
    }
    const Ints enough = INTS_OF_SHORTS(voters) >= EGOSGM_FILL_MIN_COUNT;
    const Ints is_hole = votes[0] == INVALID, is_filled = is_hole & enough;
    store_pixels((is_hole != is_filled) ? INVALID : middle, filtered + row, x, width);
    const Floats kept_variance = load_pixels(variance + row, x, width);
    store_pixels(is_filled ? (Floats)(EGOSGM_FILLED_VARIANCE_PX2) : kept_variance, variance + row, x, width);
  }
}

KERNEL void weigh(const ImageSize size, const int row_step, const float least, const float steps_per_px,
                  global const uchar* images, global const float* disparity, global float* filtered,
                  global float* variance) {
  weigh_row(THIS_WORK_ITEM, size, row_step, least, steps_per_px, images, disparity, filtered, variance);
}
