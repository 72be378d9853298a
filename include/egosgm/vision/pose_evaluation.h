// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "egosgm/export.h"

namespace egosgm::vision {

/// The error of one motion, from one frame to the next.
struct RelativePoseError {
  double translation_m = 0;
  double rotation_rad = 0;
};

/// KITTI odometry's figure: the error of the motion over all segments of one length.
struct SegmentError {
  double length_m = 0;
  int segments = 0;                // how many were found
  double translation_percent = 0;  // of the segment's length
  double rotation_deg_per_m = 0;
};

struct PoseEvaluation {
  std::vector<RelativePoseError> motions;  // one per frame but the first
  double translation_mean_m = 0;           // of the motions
  double rotation_mean_rad = 0;
  double translation_rmse_m = 0;
  double rotation_rmse_rad = 0;
  double path_length_m = 0;  // of the truth
  double end_drift_m = 0;    // distance of the last positions, the first poses laid on each other
  double end_drift_percent = 0;
  double rotation_end_drift_deg = 0;
  std::vector<SegmentError> segments;  // lengths without a segment are left out
  bool short_segments =
      false;  // 5, 10, ... 50 m, for a path of less than 100 m: not comparable with KITTI's 100 ... 800 m
  double segment_translation_percent = 0;  // mean over all segments; NaN where there is none
  double segment_rotation_deg_per_m = 0;
};

/// Compares camera-to-world poses frame by frame (A. Geiger, P. Lenz, R. Urtasun, "Are we ready for Autonomous
/// Driving?", CVPR 2012). Segments start at every tenth frame, short ones at every frame. Throws InvalidArgument unless
/// both have the same number of poses, at least two. Percentages are NaN for a path of zero length. Thread-safe.
EGOSGM_EXPORT PoseEvaluation evaluate_poses(const std::vector<Eigen::Isometry3d>& estimate,
                                            const std::vector<Eigen::Isometry3d>& truth);

}  // namespace egosgm::vision
