// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/motion.h"
#include "egosgm/odometry.h"
#include "vision/frame_source.h"
#include "vision/pose_check.h"

namespace egosgm::vision {

/// The camera's motion to a frame, and its source.
struct FrameMotion {
  std::optional<Motion> motion;  // from the previous frame; none in the first frame
  bool is_given = false;         // else estimated:
  OdometryResult odometry;
  double odometry_ms = 0;
  Eigen::Isometry3d first_from_camera =
      Eigen::Isometry3d::Identity();  // the pose, in the system of the first frame that came
};

/// The motion of one frame after the other: from a file of poses, from poses that come with the frames, or by stereo
/// odometry, also where one of two frames came without its pose. A frame where odometry found none repeats the last
/// motion in its pose, and only there. Not thread-safe.
class EGOSGM_EXPORT MotionSource {
 public:
  /// `calibration`: none where nothing can be predicted. Throws InvalidArgument.
  MotionSource(const std::optional<Calibration>& calibration, const StereoOdometryOptions& options);
  /// Reads `poses_file`; empty: there is none. Throws InvalidArgument.
  MotionSource(const StereoSequence& sequence, const std::string& poses_file, const StereoOdometryOptions& options);

  /// The motion from the frame of the last call, unless this one starts anew. REQUIRES: `frame`, a place in the
  /// sequence, grows from call to call.
  FrameMotion next(const VideoPair& pair, std::size_t frame);

  bool has_odometry() const { return odometry_.has_value(); }
  /// Whether a file tells the poses.
  bool has_file() const { return !poses_.empty(); }

  /// The objection of the first frames' odometry to the given poses; empty without one, and without poses. To be
  /// asked from the thread of `next`.
  std::string warning() const { return suspect_motions(given_, found_); }

 private:
  void estimate(const VideoPair& pair, FrameMotion& result);
  void take(const Eigen::Isometry3d& pose, FrameMotion& result);
  void follow(FrameMotion& result);

  std::vector<Isometry> poses_;
  std::optional<StereoOdometry> odometry_;
  std::size_t frames_ = 0;
  std::optional<Eigen::Isometry3d> last_pose_;
  Eigen::Isometry3d first_pose_ = Eigen::Isometry3d::Identity();  // of the file, of the first frame that came
  Eigen::Isometry3d first_from_camera_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d last_motion_ = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Isometry3d> given_;  // of the first frames, and what odometry found
  std::vector<std::optional<Eigen::Isometry3d>> found_;
};

}  // namespace egosgm::vision
