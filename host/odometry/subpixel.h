// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/odometry/features.h"

namespace egosgm::odometry {

inline constexpr int kPatchRadius = 5;
inline constexpr int kPatchRows = 2 * kPatchRadius + 1;
inline constexpr int kPatchColumns = 12;  // one more than rows, with no weight: whole vectors

/// A patch to be found again by inverse compositional alignment (Baker and Matthews, IJCV 2004). Its gradients are
/// orthogonal to a constant and to the patch itself, so a change of brightness or contrast has no effect.
struct Patch {
  float values[kPatchRows][kPatchColumns];
  float gradient_x[kPatchRows][kPatchColumns];
  float gradient_y[kPatchRows][kPatchColumns];
  float inverse_xx, inverse_xy, inverse_yy;  // of the normal equations
  float deviation;                           // root of the summed squared deviation of the values
};

/// The patch around (x, y) as it looks enlarged by `scale`. False where the texture fixes no position.
bool make_patch(const GreyImage& image, float x, float y, float scale, Patch& patch);

/// Moves (x, y) to where `image` looks like the patch. False if that is more than four pixels off, if it does not
/// settle, or if the correlation stays below `min_correlation`.
bool align_patch(const Patch& patch, const GreyImage& image, float min_correlation, float& x, float& y);

}  // namespace egosgm::odometry
