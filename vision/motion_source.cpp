// SPDX-License-Identifier: Apache-2.0
#include "vision/motion_source.h"

#include <chrono>

#include "egosgm/error.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/poses_io.h"

namespace egosgm::vision {
namespace {

constexpr std::size_t kLookedAt = 6;  // motions that are given, beside those of the odometry

}  // namespace

MotionSource::MotionSource(const std::optional<Calibration>& calibration, const StereoOdometryOptions& options) {
  options.validate();
  if (calibration) odometry_.emplace(*calibration, options);
}

MotionSource::MotionSource(const StereoSequence& sequence, const std::string& poses_file,
                           const StereoOdometryOptions& options)
    : MotionSource(sequence.has_calibration ? std::optional(sequence.calibration) : std::nullopt, options) {
  if (poses_file.empty()) return;
  if (!sequence.has_calibration) {
    throw InvalidArgument("--poses " + poses_file + ": a motion predicts nothing without a calibration: give --calib");
  }
  poses_ = poses_of_frames(sequence, poses_file);
}

FrameMotion MotionSource::next(const VideoPair& pair, std::size_t frame) {
  FrameMotion result;
  if (pair.starts_anew) {
    if (odometry_) odometry_->reset();
    last_pose_.reset();
    last_motion_ = Eigen::Isometry3d::Identity();
  }
  const std::optional<Eigen::Isometry3d> pose =
      poses_.empty() ? pair.world_from_camera : std::optional<Eigen::Isometry3d>(poses_[frame]);
  // A file has poses of all frames: odometry only looks at the first ones.
  if (odometry_ && (poses_.empty() || frames_ <= kLookedAt)) estimate(pair, result);
  if (pose) {
    take(*pose, result);
  } else {
    last_pose_.reset();
  }
  if (odometry_) follow(result);
  ++frames_;
  return result;
}

void MotionSource::estimate(const VideoPair& pair, FrameMotion& result) {
  const auto start = std::chrono::steady_clock::now();
  result.odometry = odometry_->process(image_view(pair.images.left), image_view(pair.images.right));
  result.odometry_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  result.motion = result.odometry.motion;
}

void MotionSource::take(const Eigen::Isometry3d& pose, FrameMotion& result) {
  if (last_pose_) {
    const Eigen::Isometry3d given = current_from_previous(*last_pose_, pose);
    if (given_.size() < kLookedAt) {
      given_.push_back(given);
      found_.push_back(result.motion ? std::optional<Eigen::Isometry3d>(result.motion->current_from_previous)
                                     : std::nullopt);
    }
    result.motion = Motion{.current_from_previous = given};
  }
  result.is_given = last_pose_ || !poses_.empty();
  last_pose_ = pose;
}

/// The camera's way: by the file's poses themselves, or by one motion after the other.
void MotionSource::follow(FrameMotion& result) {
  if (result.motion) last_motion_ = result.motion->current_from_previous;
  if (!poses_.empty()) {
    if (frames_ == 0) first_pose_ = *last_pose_;
    first_from_camera_ = first_pose_.inverse() * *last_pose_;
  } else if (frames_ > 0) {
    first_from_camera_ = first_from_camera_ * last_motion_.inverse();
  }
  result.first_from_camera = first_from_camera_;
}

}  // namespace egosgm::vision
