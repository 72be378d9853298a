// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/odometry.h"
#include "host/odometry/geometry.h"

namespace egosgm::odometry {

struct MotionEstimate {
  Motion motion;
  std::vector<int> inliers;
  double rms_px = 0;   // reprojection error of the inliers in both images
  std::string reason;  // why there is no motion; empty where there is one
};

/// Motion by RANSAC over three matches, each sample from three parts of the image. `guess` is where each sample's
/// iterations start. A match counts the less, the more matches lie in its part of the image, so that a large near
/// object does not outvote a scene that is seen all over. Deterministic.
MotionEstimate estimate_motion(const Calibration& calibration, const StereoOdometryOptions& options,
                               const std::vector<PointMatch>& matches, const Eigen::Isometry3d& guess,
                               double threshold_px);

/// Refines all six parameters: iteratively reweighted Gauss-Newton over the reprojection error in both images, each
/// match weighted by what its noise, depth's included, lets expect. Takes new inliers from all matches.
MotionEstimate refine_motion(const Calibration& calibration, const StereoOdometryOptions& options,
                             const MatchNoise& noise, const std::vector<PointMatch>& matches,
                             const Eigen::Isometry3d& start);

/// `motion`, and then the rigid motion that the twist `xi` (translation, rotation) makes in a unit of time.
Eigen::Isometry3d perturb(const Vector6& xi, const Eigen::Isometry3d& motion);

/// Why `motion` is out of the bounds in `options`; empty where it is not.
std::string out_of_bounds(const StereoOdometryOptions& options, const Eigen::Isometry3d& motion);

}  // namespace egosgm::odometry
