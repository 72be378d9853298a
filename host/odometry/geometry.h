// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "egosgm/calibration.h"

namespace egosgm::odometry {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using MotionJacobian = Eigen::Matrix<double, 3, 6>;

/// A static point seen by both cameras at two times [px]. `u` and `v` are of the left image, `d` is the disparity.
struct PointMatch {
  double u1, v1, d1;      // previous frame
  double u2, v2, d2;      // current frame
  double row_error2 = 0;  // of the current frame: v_right - v_left, 0 in a perfectly rectified pair
};

/// The standard deviation of what was measured [px].
struct MatchNoise {
  double position_px = 0.25;   // of (u2, v2) against (u1, v1)
  double disparity_px = 0.25;  // of d1 and of d2
};

inline constexpr double kMinDisparity_px = 0.1;
inline constexpr double kMinDepth_m = 0.1;

inline double positive_disparity(const Calibration& c, double d) { return std::max(d + c.doffs_px, kMinDisparity_px); }

/// In the left camera's frame.
inline Eigen::Vector3d triangulate(const Calibration& c, double u, double v, double d) {
  const double z = c.fx * c.baseline_m / positive_disparity(c, d);
  return {(u - c.cx) * z / c.fx, (v - c.cy) * z / c.fy, z};
}

/// (u, v, d) of a point in the left camera's frame.
inline Eigen::Vector3d project(const Calibration& c, const Eigen::Vector3d& p) {
  const double inverse = 1 / p.z();
  return {c.fx * p.x() * inverse + c.cx, c.fy * p.y() * inverse + c.cy, c.fx * c.baseline_m * inverse - c.doffs_px};
}

/// The derivative of (u, v, d) by the point.
inline Eigen::Matrix3d projection_jacobian(const Calibration& c, const Eigen::Vector3d& p) {
  const double i = 1 / p.z(), i2 = i * i;
  Eigen::Matrix3d j;
  j << c.fx * i, 0, -c.fx * p.x() * i2, 0, c.fy * i, -c.fy * p.y() * i2, 0, 0, -c.fx * c.baseline_m * i2;
  return j;
}

/// The derivative of (u, v, d) by a left perturbation (translation, rotation) of the motion that took the point to `p`.
inline MotionJacobian motion_jacobian(const Eigen::Matrix3d& projection, const Eigen::Vector3d& p) {
  Eigen::Matrix3d rotation;  // -[p]x
  rotation << 0, p.z(), -p.y(), -p.z(), 0, p.x(), p.y(), -p.x(), 0;
  MotionJacobian j;
  j << projection, projection * rotation;
  return j;
}

/// One match under a motion, linearised: measured - predicted, and what that depends on.
struct Residual {
  Eigen::Vector3d value;                 // (u2, v2, d2) - prediction
  MotionJacobian by_motion;              // of the prediction
  Eigen::Vector3d by_disparity;          // of the prediction, by d1: it moves the point along its ray
  Eigen::Matrix<double, 3, 2> by_pixel;  // of the prediction, by (u1, v1)
  Eigen::Matrix3d information;           // inverse of the covariance of `value`
};

/// All but the information, around the disparity `d1` in place of the measured one.
inline Residual linearise_at(const Calibration& c, const PointMatch& match, double d1,
                             const Eigen::Isometry3d& motion) {
  const Eigen::Vector3d point = triangulate(c, match.u1, match.v1, d1);
  const Eigen::Vector3d rotated = motion.linear() * point;
  const Eigen::Vector3d p = rotated + motion.translation();
  const Eigen::Matrix3d projection = projection_jacobian(c, p);
  Residual residual;
  residual.by_motion = motion_jacobian(projection, p);
  residual.by_disparity = projection * rotated * (-1 / positive_disparity(c, d1));
  residual.value =
      Eigen::Vector3d(match.u2, match.v2, match.d2) - project(c, p) - residual.by_disparity * (match.d1 - d1);
  residual.by_pixel.col(0) = projection * motion.linear().col(0) * (point.z() / c.fx);
  residual.by_pixel.col(1) = projection * motion.linear().col(1) * (point.z() / c.fy);
  return residual;
}

/// Around the disparity that both frames make most likely: around the measured one, its noise would go into the
/// derivatives too, and pull what many residuals tell all one way.
inline Residual linearise(const Calibration& c, const MatchNoise& noise, const PointMatch& match,
                          const Eigen::Isometry3d& motion) {
  const double position2 = noise.position_px * noise.position_px, disparity2 = noise.disparity_px * noise.disparity_px;
  const Eigen::Vector3d information(1 / position2, 1 / position2, 1 / disparity2);  // of (u2, v2, d2)
  Residual residual = linearise_at(c, match, match.d1, motion);
  const Eigen::Vector3d gain = information.cwiseProduct(residual.by_disparity);
  const double step = gain.dot(residual.value) / (1 / disparity2 + gain.dot(residual.by_disparity));
  residual = linearise_at(c, match, match.d1 + step, motion);
  // Inverse of diag(information)^-1 + disparity2 b b^T (Sherman and Morrison).
  const Eigen::Vector3d b = information.cwiseProduct(residual.by_disparity);
  residual.information = -b * b.transpose() / (1 / disparity2 + b.dot(residual.by_disparity));
  residual.information.diagonal() += information;
  return residual;
}

/// Cauchy's weight of a squared Mahalanobis distance.
inline double cauchy_weight(double squared, double scale2) { return 1 / (1 + squared / scale2); }

}  // namespace egosgm::odometry
