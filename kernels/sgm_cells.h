// SPDX-License-Identifier: Apache-2.0
// What both ways of BandedSgm (banded_sgm.cl, banded_sgm_paths.cl) make of a winner. OpenCL C only.
#ifndef EGOSGM_KERNELS_SGM_CELLS_H
#define EGOSGM_KERNELS_SGM_CELLS_H

#include "shared.h"

// Disparity with its sub-pixel part, by a symmetric V through the winner and its neighbours, whose sums lie that much
// above its own; 0 both where one is missing.
inline float refined(const int winner, const int rise_before, const int rise_after) {
  const float before = (float)rise_before, after = (float)rise_after;
  const float slope = max(before, after);
  const float offset = (before - after) / (2.0f * (slope > 0.0f ? slope : 1.0f));
  return (float)winner + (slope > 0.0f ? clamp(offset, -0.5f, 0.5f) : 0.0f);
}

// The matching variance (options.h), or that of a winner beyond which the sums fall on.
inline float matching_variance(const SgmParameters q, const int steps, const int rise_before, const int rise_after) {
  const float n = (float)steps;
  const float counted = q.variance_floor + n * (q.variance_per_step + q.variance_per_square * n);
  return rise_before < 0 || rise_after < 0 ? EGOSGM_ESCAPED_VARIANCE_PX2 : counted;
}

#endif
