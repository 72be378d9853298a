// SPDX-License-Identifier: Apache-2.0
// Objects that move by themselves, and scene flow.
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/motion.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// A rigid surface that moves by itself.
struct MovingObject {
  int id = 0;                                    // 1 to 255; kept while each frame finds the object
  int age = 0;                                   // pairs of frames that found it, one after the other
  int pixels = 0;                                // that have its label
  int left = 0, top = 0, right = 0, bottom = 0;  // box of these pixels, all four within it
  Eigen::Vector3d centre_m{0, 0, 0};             // of its visible surface, in the camera's frame
  Eigen::Vector3d velocity_m{0, 0, 0};  // of the centre per frame, without the camera's motion, in the camera's frame
  Eigen::Matrix3d velocity_covariance_m2 = Eigen::Matrix3d::Zero();
  Isometry current_from_previous = Isometry::Identity();  // of its points, between camera frames
};

/// The objects of a frame. `labels`: kU8, the object's id at each pixel of the left view, or 0.
struct LabelledObjects {
  std::vector<MovingObject> moving;
  Image labels;
};

/// Where the pixels of the frame before the newest one lie in the newest one. All maps are at the earlier frame's
/// pixels. Labelled pixels move with their object, all others with the camera. interpolate_background fills the holes
/// of the disparity first, so that every pixel has flow.
struct SceneFlow {
  Image disparity;                   // kF32 [px], of the earlier frame
  Image next_disparity;              // kF32 [px], of the same points in the newest frame
  Image flow;                        // kFlow [px], to the right and down
  Image labels;                      // kU8, as in LabelledObjects
  std::vector<MovingObject> moving;  // boxes, centres and velocities are those in the earlier frame
  Motion camera;                     // from the earlier frame to the newest one
};

/// Follows what moves by itself over the frames of a stereo video.
///
/// Groups of pixels that the pipeline's map `dynamic` marks become candidates. Direct alignment of images and
/// disparities (Gauss-Newton with Cauchy's weights) gives each its rigid motion from the frame before. The images say
/// which pixels near it move so, rather than with the camera. A candidate is an object where its motion contradicts the
/// camera's beyond noise. In the next frame the object is looked for where its motion leads; it ends where its velocity
/// jumps.
///
/// Deterministic: the same input gives the same bits; one thread. Not thread-safe: use one object per thread. An object
/// that was moved from may be destroyed or assigned to, and nothing else.
class EGOSGM_EXPORT ObjectTracker {
 public:
  /// Throws InvalidArgument where the calibration cannot be used.
  explicit ObjectTracker(const Calibration& calibration);
  ~ObjectTracker();
  ObjectTracker(ObjectTracker&&) noexcept;
  ObjectTracker& operator=(ObjectTracker&&) noexcept;

  /// The next frame: its left image (kU8 or kU16), the pipeline's `disparity` (kF32) and `dynamic` (kU8) of it, and the
  /// camera's motion from the frame before. Without a motion all objects end. In a left image that
  /// equals the last one nothing moves; the motion that came with it counts for the next one, in which objects go on.
  /// Throws InvalidArgument where sizes or types differ, or the motion is none; the state is then as before the call.
  LabelledObjects process(const Image& left, const Image& disparity, const Image& dynamic,
                          const std::optional<Motion>& motion);

  /// From the frame before to the newest one; none where the newest one came without a motion, or is the first.
  std::optional<SceneFlow> scene_flow() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace egosgm::vision
