// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// A left image for comparisons between frames: grey values without their local mean, at full, half and a quarter of
/// the resolution, and its disparities.
struct AlignedView {
  static constexpr int kLevels = 3;
  Image greys[kLevels];  // kF32, in 256ths of the type's range
  Image disparity;       // kF32, as the pipeline gives it
  Image filled;          // kF32, without holes
};

AlignedView make_view(const Image& left, const Image& disparity);

/// A pixel of a view and its point in the camera's frame.
struct SurfacePoint {
  double u, v;
  Eigen::Vector3d point_m;
};

/// Grey values and disparities that noise alone makes differ.
struct AlignmentNoise {
  double grey = 3;
  double disparity_px = 1;
};

struct RigidFit {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();  // from the points' frame to the other one
  Eigen::Vector3d centre_m{0, 0, 0};                         // of the moved points
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();  // of a shift, and a turn about it
  double share = 0;                                                              // of the points that agree with it
};

/// The rigid motion that moves `points` of one view to where the other view looks alike: Gauss-Newton over grey values
/// and disparities, from a quarter of the resolution to the full one. `start` is the first guess, and the rotation is
/// kept near its own. None where too few points say anything.
std::optional<RigidFit> align_rigidly(const Calibration& calibration, const AlignedView& from, const AlignedView& to,
                                      const std::vector<SurfacePoint>& points, const Eigen::Isometry3d& start,
                                      const AlignmentNoise& noise);

/// `camera`, with the shift in the image [px, of `to`] that makes most points look alike within `radius` put before it.
Eigen::Isometry3d best_shift(const Calibration& calibration, const AlignedView& from, const AlignedView& to,
                             const std::vector<SurfacePoint>& points, const Eigen::Isometry3d& camera,
                             const AlignmentNoise& noise);

}  // namespace egosgm::vision
