// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "egosgm/motion.h"
#include "tests/fuzz/bytes.h"

namespace egosgm::fuzz {

/// Mostly a rigid motion, of any size and also behind the camera; now and then a matrix or a covariance that is none.
inline Motion random_motion(Bytes& bytes) {
  Motion motion;
  Eigen::Vector3d rotation;
  for (int i = 0; i < 3; ++i) rotation[i] = bytes.number();
  const double angle = rotation.norm();
  if (std::isfinite(angle) && angle > 0) {
    motion.current_from_previous.linear() = Eigen::AngleAxisd(angle, rotation / angle).toRotationMatrix();
  }
  for (int i = 0; i < 3; ++i) motion.current_from_previous.translation()[i] = bytes.number();
  if (bytes.below(8) == 0) {
    const int row = bytes.below(4), column = bytes.below(4);
    motion.current_from_previous.matrix()(row, column) = bytes.number();
  }
  if (bytes.coin()) {
    const Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::NullaryExpr([&] { return bytes.number(); });
    motion.covariance = root * root.transpose();
  }
  return motion;
}

}  // namespace egosgm::fuzz
