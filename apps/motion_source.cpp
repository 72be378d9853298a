// SPDX-License-Identifier: Apache-2.0
#include "apps/motion_source.h"

#include <algorithm>
#include <chrono>

#include "egosgm/error.h"
#include "egosgm/vision/opencv.h"
#include "egosgm/vision/poses_io.h"
#include "host/vision/pose_doubt.h"

namespace egosgm::app {

void add_motion(CLI::App& command, std::string& poses_file, StereoOdometryOptions& options) {
  command
      .add_option("--poses", poses_file,
                  "take the motion from KITTI poses (camera-to-world) in place of stereo odometry")
      ->type_name("FILE")
      ->group("Method");
  add_motion_bounds(command, options, "Method");
}

void add_motion_bounds(CLI::App& command, StereoOdometryOptions& options, const std::string& group) {
  command
      .add_option("--max-translation", options.max_translation_m,
                  "odometry: a longer motion between two frames is no motion [m]")
      ->type_name("M")
      ->group(group)
      ->capture_default_str();
  command
      .add_option("--max-rotation", options.max_rotation_deg,
                  "odometry: a larger turn between two frames is no motion [deg]")
      ->type_name("DEG")
      ->group(group)
      ->capture_default_str();
}

MotionSource::MotionSource(const vision::StereoSequence& sequence, const std::string& poses_file,
                           const StereoOdometryOptions& options) {
  options.validate();
  if (!sequence.has_calibration) {
    if (poses_file.empty()) return;
    throw InvalidArgument("--poses " + poses_file + ": a motion predicts nothing without a calibration: give --calib");
  }
  if (poses_file.empty()) {
    odometry_.emplace(sequence.calibration, options);
  } else {
    poses_ = vision::poses_of_frames(sequence, poses_file);
  }
}

std::string MotionSource::doubt(const vision::StereoSequence& sequence, const StereoOdometryOptions& options) const {
  constexpr std::size_t kFrames = 7;
  if (poses_.size() < 3) return {};
  StereoOdometry odometry(sequence.calibration, options);
  std::vector<Eigen::Isometry3d> given;
  std::vector<std::optional<Eigen::Isometry3d>> found;
  for (std::size_t i = 0; i < std::min(kFrames, poses_.size()); ++i) {
    vision::StereoImages images;
    try {
      images = vision::read_images(sequence.frames[i]);
    } catch (const Error&) {
      break;  // the run says so
    }
    const auto motion = odometry.process(vision::image_view(images.left), vision::image_view(images.right)).motion;
    if (i == 0) continue;
    given.push_back(vision::current_from_previous(poses_[i - 1], poses_[i]));
    found.push_back(motion ? std::optional(motion->current_from_previous) : std::nullopt);
  }
  return vision::suspect_motions(given, found);
}

FrameMotion MotionSource::next(const vision::StereoImages& images, std::size_t frame) {
  FrameMotion result;
  if (odometry_) {
    estimate(images, result);
  } else if (!poses_.empty()) {
    take_from_file(frame, result);
  }
  last_frame_ = frame;
  return result;
}

void MotionSource::take_from_file(std::size_t frame, FrameMotion& result) {
  result.from_file = true;
  result.first_from_camera = poses_.front().inverse() * poses_[frame];
  if (!last_frame_) return;
  result.motion.emplace();
  result.motion->current_from_previous = vision::current_from_previous(poses_[*last_frame_], poses_[frame]);
}

void MotionSource::estimate(const vision::StereoImages& images, FrameMotion& result) {
  const auto start = std::chrono::steady_clock::now();
  result.odometry = odometry_->process(vision::image_view(images.left), vision::image_view(images.right));
  result.odometry_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  result.motion = result.odometry.motion;
  if (result.motion) last_motion_ = result.motion->current_from_previous;
  if (last_frame_) first_from_camera_ = first_from_camera_ * last_motion_.inverse();
  result.first_from_camera = first_from_camera_;
}

}  // namespace egosgm::app
