// SPDX-License-Identifier: Apache-2.0
// Thin things that stand before what is beside them, and outliers of what CoarseMatch found. OpenCL C only.
#ifndef EGOSGM_KERNELS_SEARCH_RIDGES_H
#define EGOSGM_KERNELS_SEARCH_RIDGES_H

#include "bands.h"
#include "method.h"

float8 infinite_where_invalid(const float8 d) { return d > EGOSGM_INVALID_DISPARITY ? d : INFINITY; }

// Which of the eight pixels from x on lie nearer than one of the `reach` pixels to their left by more than `step`, and
// than one to their right. REQUIRES: reach <= 8.
int8 ridges_from(global const float* row, int x, int width, int reach, float step) {
  const float8 d = eight(row, x, width);
  // Hardly ever does one lie that much nearer than anything here or to the right.
  const float8 right_of = infinite_where_invalid(eight(row, x + 8, width));
  const float8 around = fmin(infinite_where_invalid(d), right_of);
  const float4 least4 = fmin(around.lo, around.hi);
  const float2 least2 = fmin(least4.lo, least4.hi);
  if (!any(d - step > fmin(least2.x, least2.y))) return 0;

  float8 left = INFINITY;
  float8 right = INFINITY;
  for (int i = 1; i <= reach; ++i) {
    const float8 before = eight(row, x - i, width);
    const float8 after = eight(row, x + i, width);
    left = ((before > EGOSGM_INVALID_DISPARITY) & (before < left)) ? before : left;
    right = ((after > EGOSGM_INVALID_DISPARITY) & (after < right)) ? after : right;
  }
  return d > EGOSGM_INVALID_DISPARITY & left < d - step & right < d - step;
}

// Keeps the EGOSGM_COARSE_OUTLIERS + 1 least values of each lane, in rising order; the most, in falling order.
void insert_least(float4* least, float4 value) {
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    const float4 before = least[i];
    least[i] = value < before ? value : before;
    value = value < before ? before : value;
  }
}
void insert_most(float4* most, float4 value) {
  for (int i = 0; i <= EGOSGM_COARSE_OUTLIERS; ++i) {
    const float4 before = most[i];
    most[i] = value > before ? value : before;
    value = value > before ? before : value;
  }
}

#endif
