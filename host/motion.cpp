// SPDX-License-Identifier: Apache-2.0
#include "egosgm/motion.h"

#include <string>

#include "egosgm/error.h"

namespace egosgm {

void Motion::validate() const {
  if (!current_from_previous.matrix().allFinite())
    throw InvalidArgument("motion: not all values are finite: check its source");
  const Eigen::Matrix3d rotation = current_from_previous.linear();
  const double deviation = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  const bool is_orthonormal = deviation <= 1e-4;
  if (!is_orthonormal || rotation.determinant() < 0) {
    const std::string why = is_orthonormal ? "it mirrors" : "R R^T differs from 1 by " + std::to_string(deviation);
    throw InvalidArgument("motion: its 3x3 part is not a rotation (" + why + "): give an orthonormal right-handed one");
  }
  if (current_from_previous.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    throw InvalidArgument("motion: the last row of its 4x4 matrix is not 0 0 0 1: give a rigid motion");
  }
  if (!covariance.allFinite() || !covariance.isApprox(covariance.transpose(), 1e-6) ||
      covariance.diagonal().minCoeff() < 0) {
    throw InvalidArgument(
        "motion: the covariance is not symmetric with a non-negative diagonal: give zero if it is not known");
  }
}

Motion operator*(const Motion& second, const Motion& first) {
  const Eigen::Matrix3d rotation = second.current_from_previous.linear();
  const Eigen::Vector3d t = second.current_from_previous.translation();
  const Eigen::Matrix3d cross = (Eigen::Matrix3d() << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0).finished();
  Eigen::Matrix<double, 6, 6> adjoint;
  adjoint << rotation, cross * rotation, Eigen::Matrix3d::Zero(), rotation;
  return {second.current_from_previous * first.current_from_previous,
          second.covariance + adjoint * first.covariance * adjoint.transpose()};
}

}  // namespace egosgm
