// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/calibration.h"
#include "egosgm/motion.h"

namespace egosgm::reference {

/// A pixel of a view and its disparity [px].
struct DisparityPoint {
  double x, y, disparity;
};

/// Where the point that `view` sees at `point` is seen after the camera's motion: eqs. 1 to 4, one after the other,
/// without H. REQUIRES: a disparity that is no infinite depth.
DisparityPoint moved(const Calibration& calibration, const Motion& current_from_previous, int view,
                     const DisparityPoint& point);

}  // namespace egosgm::reference
