// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/odometry.h"
#include "host/odometry/features.h"
#include "host/odometry/motion.h"

namespace egosgm::odometry {

/// A frame, and what is known of its left features so far. Stereo matches are found when they are asked for.
struct TrackedFrame {
  GreyImage left, right;
  FeatureSet left_features, right_features;
  std::vector<int> right_of_left;  // index, kNoMatch or kUnknown
  std::vector<int> left_of_right;
  std::vector<float> u, v;       // refined position of a left feature; its pixel until a track refines it
  std::vector<float> disparity;  // refined at (u, v), kUntried or kCannot
  std::vector<float> row_error;  // right less left row, where the disparity is known
  std::vector<int> age;          // frames that the feature was tracked for

  void reset_matches();
};

inline constexpr int kNoMatch = -1;
inline constexpr int kUnknown = -2;

/// In place of a disparity that was not refined yet, and of one that cannot be.
inline constexpr float kUntried = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kCannot = -std::numeric_limits<float>::infinity();
inline bool is_untried(float disparity) { return std::isnan(disparity); }

/// left k-1, left k, right k and right k-1.
struct CircularMatch {
  int previous_left, current_left, current_right, previous_right;
};

struct SearchWindow {
  double x_px, y_px;  // farthest from the predicted place
};

struct StereoWindow {
  int least_px, most_px;  // disparities
};

/// The right feature that best matches left feature `i`, and whose best match `i` is.
int stereo_match(TrackedFrame& frame, int i, const StereoWindow& window);

/// Closes the circle for each of the previous frame's left features in `queries`. With `motion`, the search is
/// around the place where it takes a static point; without, around the last place. Stereo matches lie at most
/// `max_disparity_px` from infinity, whose disparity is -doffs_px.
std::vector<CircularMatch> match_circle(const Calibration& calibration, TrackedFrame& previous, TrackedFrame& current,
                                        const std::vector<int>& queries, const Eigen::Isometry3d* motion,
                                        const SearchWindow& window, int max_disparity_px);

/// The strongest `per_cell` of every cell of `cell_px` (older tracks first), by index.
std::vector<int> select_spread(const TrackedFrame& frame, int cell_px, int per_cell);

/// Matches to a fraction of a pixel. `kept` are those that could be refined, one for each point.
std::vector<PointMatch> refine_matches(const Calibration& calibration, TrackedFrame& previous, TrackedFrame& current,
                                       const std::vector<CircularMatch>& matches, const Eigen::Isometry3d& motion,
                                       std::vector<CircularMatch>& kept);

/// Matches to a pixel.
std::vector<PointMatch> pixel_matches(const TrackedFrame& previous, const TrackedFrame& current,
                                      const std::vector<CircularMatch>& matches);

}  // namespace egosgm::odometry
