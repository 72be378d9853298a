// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "egosgm/calibration.h"

namespace egosgm::vision {

constexpr double kMinDepthRatio = 1e-3;  // of the depths after and before a motion

/// Where pixels of a row go.
struct MovedRow {
  std::vector<float> u, v, d;
};

/// A rigid motion of points as a projective map of (u, v, disparity).
class PixelMotion {
 public:
  PixelMotion(const Calibration& c, const Eigen::Isometry3d& motion) {
    Eigen::Matrix4d to_space, to_pixels;       // homogeneous points over their depth
    to_space << 1 / c.fx, 0, 0, -c.cx / c.fx,  //
        0, 1 / c.fy, 0, -c.cy / c.fy,          //
        0, 0, 0, 1,                            //
        0, 0, 1 / (c.fx * c.baseline_m), c.doffs_px / (c.fx * c.baseline_m);
    to_pixels << c.fx, 0, c.cx, 0,               //
        0, c.fy, c.cy, 0,                        //
        0, 0, -c.doffs_px, c.fx * c.baseline_m,  //
        0, 0, 1, 0;
    matrix_ = to_pixels * motion.matrix() * to_space;
  }

  /// Where the point of (u, v, d) goes; none where that is near the camera or behind it.
  std::optional<Eigen::Vector3d> operator()(double u, double v, double d) const {
    const Eigen::Vector4d there = matrix_ * Eigen::Vector4d(u, v, d, 1);
    if (!(there.w() > kMinDepthRatio)) return std::nullopt;
    return there.head<3>() / there.w();
  }

  /// The same of `count` pixels x, x + 1, ... of row v, whose disparities are `d`, in floats. kNoValue: none.
  void of_row(int x, int v, const float* d, int count, MovedRow& there) const;

 private:
  Eigen::Matrix4d matrix_;
};

}  // namespace egosgm::vision
