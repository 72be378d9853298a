// SPDX-License-Identifier: Apache-2.0
// Left-right consistency: the left pixel x sees what the right pixel x - d sees, the right pixel x what the left pixel
// x + d sees.
#include "shared.h"

kernel void check(const ImageSize size, const float max_difference, const int keep_outside, global const float* disparity,
                  global const float* variance, global float* kept_disparity, global float* kept_variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= size.width) return;
  const size_t i = ((size_t)view * size.height + y) * size.width + x;
  const size_t other_row = ((size_t)(1 - view) * size.height + y) * size.width;

  const float d = disparity[i];
  // Asked of the float, with comparisons that NaN fails, before it becomes an integer.
  const float at = rint(view == EGOSGM_LEFT ? (float)x - d : (float)x + d);
  const bool valid = d > EGOSGM_INVALID_DISPARITY;
  const bool inside = valid & (at >= 0.0f) & (at < (float)size.width);
  const int other_x = (int)(inside ? at : 0.0f);
  const float other = inside ? disparity[other_row + other_x] : EGOSGM_INVALID_DISPARITY;
  const bool agree = inside ? (other > EGOSGM_INVALID_DISPARITY) & (fabs(other - d) <= max_difference) : valid & (keep_outside != 0);

  kept_disparity[i] = agree ? d : EGOSGM_INVALID_DISPARITY;
  kept_variance[i] = agree ? variance[i] : 0.0f;
}
