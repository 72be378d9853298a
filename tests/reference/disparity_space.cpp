// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/disparity_space.h"

namespace egosgm::reference {

DisparityPoint moved(const Calibration& c, const Motion& motion, int view, const DisparityPoint& point) {
  const bool is_right = view == 1;
  const double fb = c.fx * c.baseline_m, cx = is_right ? c.cx + c.doffs_px : c.cx;
  // Eqs. 1 and 2, from disparity space to the view's camera: Z = f b / d, and X and Y in the ratio of the focal length.
  const double d = point.disparity + c.doffs_px;
  const double z = fb / d, x = (point.x - cx) * z / c.fx, y = (point.y - c.cy) * z / c.fy;
  // Eq. 3: the rigid motion, which is told of the left camera. The right one stands a baseline to its right.
  const double shift = is_right ? c.baseline_m : 0;
  const double from[3] = {x + shift, y, z};
  double to[3];
  for (int i = 0; i < 3; ++i) {
    to[i] = motion.current_from_previous.matrix()(i, 3);
    for (int j = 0; j < 3; ++j) to[i] += motion.current_from_previous.matrix()(i, j) * from[j];
  }
  to[0] -= shift;
  // Eq. 4: and back.
  return {c.fx * to[0] / to[2] + cx, c.fy * to[1] / to[2] + c.cy, fb / to[2] - c.doffs_px};
}

}  // namespace egosgm::reference
