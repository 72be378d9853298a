// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/image.h"
#include "egosgm/motion.h"

namespace egosgm {

struct EGOSGM_EXPORT StereoOdometryOptions {
  // Bounds on the motion between two frames. What lies beyond them is reported as "no motion".
  double max_translation_m = 5.0;
  double max_rotation_deg = 15.0;

  // Features.
  int corner_threshold = 40;    // least response of the 5x5 corner and blob filters, 8-bit grey values
  int max_features = 2400;      // strongest that are kept in the left image, spread over buckets
  double max_disparity_px = 0;  // widest stereo search, from infinity on; 0: a fifth of the image's width
  double max_flow_x_px = 180;   // widest search in time without a prior
  double max_flow_y_px = 90;

  // Learn, from the odometry's own residuals, what is left of rotation and distortion in the rectified images.
  // Off: the calibration is taken as it is.
  bool learn_rectification = true;

  // Motion.
  int ransac_iterations = 500;
  double inlier_threshold_px = 1.5;  // reprojection error
  int min_inliers = 20;
  double min_inlier_ratio = 0.65;  // of the circular matches; it is less where near and far points disagree
  std::uint64_t seed = 1;          // of the sampling; nothing else is random

  /// Throws InvalidArgument, naming the value, unless every value is finite and in its range.
  void validate() const;
};

/// Wall clock of a frame's steps [ms].
struct OdometryTimes {
  double features = 0;      // both images: filters, suppression, descriptors
  double rough_motion = 0;  // few features: circular matching, RANSAC
  double matching = 0;      // all features: circular matching near the rough motion, refinement to a part of a pixel
  double motion = 0;        // refinement of all six parameters, covariance
  double learning = 0;      // of the rectification error
};

struct OdometryResult {
  std::optional<Motion> motion;    // from the previous frame to this one, with its covariance
  bool standstill = false;         // the motion is the identity: what was measured is no more than its noise
  int features = 0;                // in this frame's left image
  int matches = 0;                 // that closed the circle left k-1, left k, right k, right k-1
  int inliers = 0;                 // of them, that agree with the motion
  double reprojection_rms_px = 0;  // of the inliers, in both images
  std::string reason;              // why there is no motion; empty where there is one
  OdometryTimes times_ms;
};

/// Ego-motion from rectified stereo video: corner and blob features, circular matching, RANSAC, and refinement
/// of all six parameters by robust reprojection error in both images. Cvisic and Petrovic, Stereo odometry based
/// on careful feature selection and tracking (ECMR 2015); filters after Geiger et al., StereoScan (IV 2011).
///
/// One frame is kept, so each image is processed once. While the camera stands, motions are exactly the identity, and
/// the frame where it stopped is the one that is kept. Deterministic: the same images give the same bits; one thread.
/// Not thread-safe: use one object per thread. An object that was moved from may be destroyed or assigned to, and
/// nothing else.
class EGOSGM_EXPORT StereoOdometry {
 public:
  /// Throws InvalidArgument where the calibration or an option cannot be used.
  explicit StereoOdometry(const Calibration& calibration, const StereoOdometryOptions& options = {});
  ~StereoOdometry();
  StereoOdometry(StereoOdometry&&) noexcept;
  StereoOdometry& operator=(StereoOdometry&&) noexcept;

  /// The next frame. `prior` (current_from_previous, for example an IMU's rotation with the last motion's translation)
  /// only guides the search; without it, the last frame's motion does. The first frame has no motion.
  /// Throws InvalidArgument where the images are empty, differ in size or type, have rows that overlap, or
  /// changed size since the last frame, or the prior is no motion; the state is then as before the call.
  OdometryResult process(const ImageView& left, const ImageView& right,
                         const std::optional<Isometry>& prior = std::nullopt);

  /// Forgets all frames: the next one is a first frame.
  void reset();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace egosgm
