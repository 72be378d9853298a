// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "egosgm/export.h"

namespace egosgm {

/// The motion of the left camera: `current_from_previous` takes a point from the previous left camera's frame
/// (x right, y down, z forward, metres) to the current one's.
struct EGOSGM_EXPORT Motion {
  Eigen::Isometry3d current_from_previous = Eigen::Isometry3d::Identity();

  /// Covariance of a left perturbation exp(xi) * current_from_previous, xi = (translation [m], rotation [rad]).
  /// Zero where it is not known.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();

  /// Throws InvalidArgument unless all values are finite, the rotation is one (R R^T = I within 1e-4,
  /// det R > 0), the last row 0 0 0 1, and the covariance symmetric with a non-negative diagonal.
  void validate() const;
};

/// The motion `first`, and `second` after it; their covariances are added.
EGOSGM_EXPORT Motion operator*(const Motion& second, const Motion& first);

}  // namespace egosgm
