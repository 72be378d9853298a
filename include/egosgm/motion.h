// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "egosgm/export.h"

namespace egosgm {

/// A rigid motion or a pose: as Eigen::Isometry3d, to and from which it converts. Its layout is the same whatever
/// processor a program is compiled for; that of Eigen's own changes by -march=native and -mavx.
using Isometry = Eigen::Transform<double, 3, Eigen::Isometry, Eigen::DontAlign>;

/// The motion of the left camera: `current_from_previous` takes a point from the previous left camera's frame
/// (x right, y down, z forward, metres) to the current one's.
struct EGOSGM_EXPORT Motion {
  Isometry current_from_previous = Isometry::Identity();

  /// Covariance of a left perturbation exp(xi) * current_from_previous, xi = (translation [m], rotation [rad]).
  /// Zero where it is not known.
  Eigen::Matrix<double, 6, 6, Eigen::DontAlign> covariance = Eigen::Matrix<double, 6, 6>::Zero();

  /// Throws InvalidArgument unless all values are finite, the rotation is one (R R^T = I within 1e-4,
  /// det R > 0), the last row 0 0 0 1, and the covariance symmetric with a non-negative diagonal.
  void validate() const;
};

/// The motion `first`, and `second` after it; their covariances are added.
EGOSGM_EXPORT Motion operator*(const Motion& second, const Motion& first);

}  // namespace egosgm
