// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/export.h"

namespace egosgm {

/// A rectified stereo pair: focal lengths and principal point of the left camera, and where the right one stands.
/// Disparity is d = x_left - x_right, depth is Z = fx * baseline_m / (d + doffs_px).
struct EGOSGM_EXPORT Calibration {
  double fx = 0, fy = 0;  // focal length [px]
  double cx = 0, cy = 0;  // principal point of the left camera [px], pixel centres at integers
  double baseline_m = 0;  // the right camera stands at (baseline_m, 0, 0) in the left camera's frame
  double doffs_px = 0;    // principal points' difference, cx_right - cx (Middlebury's doffs; 0 for KITTI)

  /// Throws InvalidArgument, naming the value, unless all are finite and fx, fy, baseline_m are positive.
  void validate() const;
};

}  // namespace egosgm
