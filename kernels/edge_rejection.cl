// SPDX-License-Identifier: Apache-2.0
// Edge rejection: drops a disparity whose nearest valid neighbour among the next two pixels to the left, right, above
// or below differs by more than max_jump. Both sides of a jump see each other, so both go.
#include "shared.h"

kernel void reject(const ImageSize size, const float max_jump, global const float* disparity,
                   global const float* variance, global float* kept_disparity, global float* kept_variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + y) * size.width + x;
  const size_t row = size.width;
  const float invalid = EGOSGM_INVALID_DISPARITY;

  const float left_1 = x >= 1 ? disparity[i - 1] : invalid;
  const float left_2 = x >= 2 ? disparity[i - 2] : invalid;
  const float right_1 = x + 1 < size.width ? disparity[i + 1] : invalid;
  const float right_2 = x + 2 < size.width ? disparity[i + 2] : invalid;
  const float above_1 = y >= 1 ? disparity[i - row] : invalid;
  const float above_2 = y >= 2 ? disparity[i - 2 * row] : invalid;
  const float below_1 = y + 1 < size.height ? disparity[i + row] : invalid;
  const float below_2 = y + 2 < size.height ? disparity[i + 2 * row] : invalid;

  const float left = left_1 > invalid ? left_1 : left_2;
  const float right = right_1 > invalid ? right_1 : right_2;
  const float above = above_1 > invalid ? above_1 : above_2;
  const float below = below_1 > invalid ? below_1 : below_2;

  const float d = disparity[i];
  const bool jumps = (left > invalid && fabs(left - d) > max_jump) || (right > invalid && fabs(right - d) > max_jump) ||
                     (above > invalid && fabs(above - d) > max_jump) || (below > invalid && fabs(below - d) > max_jump);
  kept_disparity[i] = jumps ? invalid : d;
  kept_variance[i] = jumps ? 0.0f : variance[i];
}
