// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/motion.h"
#include "egosgm/odometry.h"
#include "egosgm/vision/dataset.h"

namespace egosgm::app {

/// How the camera came to a frame.
struct FrameMotion {
  std::optional<Motion> motion;  // from the previous frame; none in the first frame
  bool from_file = false;        // else estimated:
  OdometryResult odometry;
  double odometry_ms = 0;
  Eigen::Isometry3d first_from_camera = Eigen::Isometry3d::Identity();  // the pose in the first frame's system
};

/// Adds --poses, --max-translation and --max-rotation to the group "Method".
void add_motion(CLI::App& command, std::string& poses_file, StereoOdometryOptions& options);

/// Adds --max-translation and --max-rotation.
void add_motion_bounds(CLI::App& command, StereoOdometryOptions& options, const std::string& group);

/// The motion of one frame after the other: from a file of poses, or by stereo odometry. A frame where odometry found
/// none repeats the last motion in its pose, and only there. Not thread-safe.
class MotionSource {
 public:
  /// Reads `poses_file`; empty: estimates. Throws InvalidArgument.
  MotionSource(const vision::StereoSequence& sequence, const std::string& poses_file,
               const StereoOdometryOptions& options);

  /// What the odometry of the first frames says against poses of a file; empty where nothing, and without such.
  std::string doubt(const vision::StereoSequence& sequence, const StereoOdometryOptions& options) const;

  /// The motion from the frame of the last call. REQUIRES: `frame`, a place in the sequence, grows from call to call.
  FrameMotion next(const vision::StereoImages& images, std::size_t frame);

 private:
  void take_from_file(std::size_t frame, FrameMotion& result);
  void estimate(const vision::StereoImages& images, FrameMotion& result);

  std::vector<Eigen::Isometry3d> poses_;
  std::optional<StereoOdometry> odometry_;
  std::optional<std::size_t> last_frame_;
  Eigen::Isometry3d first_from_camera_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d last_motion_ = Eigen::Isometry3d::Identity();
};

}  // namespace egosgm::app
