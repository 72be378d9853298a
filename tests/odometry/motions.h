// SPDX-License-Identifier: Apache-2.0
// What the tests of stereo odometry share: a camera, motions and their errors, noise to look at.
#pragma once

#include <Eigen/Geometry>
#include <random>

#include "egosgm/calibration.h"
#include "host/odometry/features.h"

namespace egosgm {

constexpr double kDegree = 3.14159265358979323846 / 180;

inline Calibration kitti_calibration() { return {707, 707, 602, 183, 0.537, 0}; }

inline Eigen::Isometry3d make_motion(double x_m, double y_m, double z_m, double yaw_deg, double pitch_deg = 0) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = (Eigen::AngleAxisd(yaw_deg * kDegree, Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(pitch_deg * kDegree, Eigen::Vector3d::UnitX()))
                        .toRotationMatrix();
  motion.translation() = Eigen::Vector3d(x_m, y_m, z_m);
  return motion;
}

struct MotionError {
  double translation_m, rotation_deg;
};

inline MotionError motion_error(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth) {
  const Eigen::Isometry3d error = estimate * truth.inverse();
  return {error.translation().norm(), Eigen::AngleAxisd(error.linear()).angle() / kDegree};
}

inline odometry::GreyImage random_image(std::mt19937& generator, int width, int height) {
  std::uniform_int_distribution<int> grey(0, 255);
  odometry::GreyImage image;
  image.width = width;
  image.height = height;
  image.pixels.resize(static_cast<std::size_t>(width) * height);
  for (auto& pixel : image.pixels) pixel = static_cast<std::uint8_t>(grey(generator));
  return image;
}

}  // namespace egosgm
