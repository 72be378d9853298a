// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/odometry/geometry.h"

namespace egosgm::odometry {

/// The residual rotation, distortion and principal point between two rectified images, learnt on the way.
///
/// A constant error of the disparity, or one that grows towards the sides of the image, gives far and near points
/// different speeds; so the odometry's own residuals, and the rows of stereo matches, tell it. On KITTI, the error
/// reaches a pixel and more at the sides (Cvisic et al., Recalibrating the KITTI dataset camera setup for improved
/// odometry accuracy, ECMR 2021).
///
/// Model of the left image's error at x = (u - cx) / fx, y = (v - cy) / fy, in pixels:
///   dx = q1 2xy + q2 (3x^2 + y^2) + l x (x^2 + y^2),  dy = q1 (x^2 + 3y^2) + q2 2xy + l y (x^2 + y^2)
/// and of the right one's against it:
///   dx = c_x + a x + r y + w x^2 + t x y + p1 2xy + p2 (3x^2 + y^2) + k x (x^2 + y^2)
///   dy = c_y + a y - r x + w x y + t y^2 + p1 (x^2 + 3y^2) + p2 2xy + k y (x^2 + y^2)
/// with principal point c, focal length a, rotations r (roll), w (yaw), t (pitch), distortion p1, p2, k.
class RectificationError {
 public:
  static constexpr int kTerms = 12;
  using Terms = Eigen::Matrix<double, kTerms, 1>;

  /// Measured less true disparity [px] at a point of the left image.
  double disparity_px(const Calibration& calibration, double u, double v) const;
  /// v_right - v_left [px] there.
  double row_px(const Calibration& calibration, double u, double v) const;

  /// Takes the error out of the disparities and the rows.
  void correct(const Calibration& calibration, std::vector<PointMatch>& matches) const;

  /// Learns from the inliers, corrected, of a motion that fits them best.
  void update(const Calibration& calibration, const MatchNoise& noise, const std::vector<PointMatch>& corrected,
              const std::vector<int>& inliers, const Eigen::Isometry3d& motion);

 private:
  struct NormalEquations {
    Eigen::Matrix<double, kTerms, kTerms> information = Eigen::Matrix<double, kTerms, kTerms>::Zero();
    Terms right = Terms::Zero();
  };
  Eigen::Matrix<double, kTerms, kTerms> prior_information(const Calibration& calibration) const;

  Terms terms_ = Terms::Zero();
  NormalEquations rows_, residuals_;  // what the rows and what the odometry's residuals have told
};

}  // namespace egosgm::odometry
