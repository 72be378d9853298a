// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/motion.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// A drive through a street of houses, parked cars, trees and thin poles, or of what has no texture: a plain sky, plain
/// ground and walls, with people and poles before them. Equal options give equal bits.
struct EGOSGM_EXPORT SyntheticOptions {
  int frames = 20;                // 1..10000
  int width = 640, height = 240;  // [px], 1..8192 each
  unsigned seed = 1;              // of street, texture and sensor noise
  bool plain = false;             // sky, ground and walls without texture, people, poles
  bool moving_object = false;  // a vehicle ahead, and from time to time one that crosses the road; plain: people walk
  bool traffic = false;  // with moving_object also an oncoming car, one that turns off, and somebody who walks across
  double moving_object_scale = 1;  // size of the vehicle ahead, 0.5..8; 5 covers 30 to 45 % of the image
  double speed_m = 0.8;            // forward travel per frame [m], 0..3
  double turn_deg = 1.0;    // largest turn per frame [deg], -4..4, positive: to the right first; radius at least 15 m
  double wobble = 1.0;      // scale of pitch, roll, sway and heave (1: 0.25 deg, 0.15 deg, 6 cm, 2 cm), 0..3
  double noise_grey = 1.5;  // standard deviation of the sensor noise, independent in both images, 0..20
  double exposure = 1.0;    // scale of the grey values before noise, 0.01..4; night: 0.08
  double pole_width_px = 3.0;   // mean width of a pole 10 m ahead [px], 1..20; single ones from 2/3 to 4/3 of it
  double pole_spacing_m = 6.0;  // mean distance of poles on either side of the road [m], 1..1000
  int supersampling = 3;        // rays per pixel and axis at the edges of surfaces, 1..8

  /// Throws InvalidArgument, naming the value.
  void validate() const;
};

/// One rendered frame, all maps `height` x `width`. Disparities are exact at the pixel's centre (intensities are
/// averaged over the pixel). They are positive, since the sky is a dome at a finite distance, but in a plain street:
/// its sky has 0 (is_sky).
struct SyntheticFrame {
  Image left, right;                      // kU8
  Image left_disparity, right_disparity;  // kF32, x_left - x_right >= 0 [px]
  Image left_noc, right_noc;              // kU8: 255 where the other camera sees the same surface point, else 0
  Image left_moving, right_moving;        // kU8: 255 on moving objects, else 0
  Isometry world_from_camera;             // left camera's pose; identity for frame 0
};

/// What moves by itself and shows in the left image of a frame.
struct SyntheticObject {
  int id = 0;                                      // 1..255, its pixels in SyntheticSceneFlow::objects
  int left = 0, top = 0, right = -1, bottom = -1;  // box of its pixels, all four within it
  Eigen::Vector3d centre_m, velocity_m;  // in the camera's frame; velocity: its own, without the camera's, per frame
  Isometry next_from_current;            // its points, from this camera's frame to the next one's
};

/// Where the surfaces of a left image are one frame later, exact at each pixel's centre, also where they are hidden
/// then. A pixel has no flow and no next disparity where its surface comes to lie behind the camera, or belongs to a
/// vehicle that leaves the street.
struct SyntheticSceneFlow {
  Image flow;            // kFlow: (u, v) to the next left image [px], NaN where there is none
  Image next_disparity;  // kF32: disparity in the next frame, at this frame's pixels; kInvalidDisparity likewise
  Image seen_next;       // kU8: 255 where the next left image shows the same surface point, else 0
  Image objects;         // kU8: ids of what moves by itself, else 0
  std::vector<SyntheticObject> moving;  // those with flow, by id
};

/// Renders any frame of the drive on demand. Thread-safe: const calls may run at the same time.
class EGOSGM_EXPORT SyntheticSequence {
 public:
  /// Throws InvalidArgument for options out of range.
  explicit SyntheticSequence(const SyntheticOptions& options);
  ~SyntheticSequence();
  SyntheticSequence(SyntheticSequence&&) noexcept;
  SyntheticSequence& operator=(SyntheticSequence&&) noexcept;

  const SyntheticOptions& options() const;
  int frames() const { return options().frames; }

  /// fx = fy = 0.58 width, as KITTI's cameras; baseline 0.54 m.
  Calibration calibration() const;

  /// REQUIRES (all of these): 0 <= frame < frames(), else InvalidArgument.
  Isometry world_from_camera(int frame) const;
  /// The motion from frame - 1 to `frame`, covariance zero; identity for frame 0.
  Motion motion(int frame) const;
  SyntheticFrame render(int frame) const;
  /// From `frame` to the one after it, which need not be below frames().
  SyntheticSceneFlow scene_flow(int frame) const;

 private:
  struct Scene;
  std::unique_ptr<const Scene> scene_;
};

/// Renders all frames into `folder` (made if missing), in the layout of KITTI odometry plus truth; N is the frame as
/// six digits:
///   image_0/N.png, image_1/N.png          left and right, 8-bit grey
///   calib.txt                             P0..P3 (P2, P3 repeat P0, P1)
///   poses.txt, times.txt                  camera-to-world rows; seconds at 10 frames per second
///   truth/left_disp_occ/N.png             disparity of every pixel, KITTI's 16-bit PNG, 1 in a plain street's sky
///   truth/left_disp_noc/N.png             the same, 0 where the right camera does not see the point
///   truth/right_disp_occ, right_disp_noc  likewise for the right view
/// With moving_object also:
///   truth/left_moving, right_moving       255 on moving objects
///   truth/objects/N.png                   8 bits: ids of the left view's moving objects, else 0
///   truth/flow/N.png, truth/disp_1/N.png  of each frame but the last: optical flow to the next left image, and the
///                                         disparity there, at this frame's pixels; KITTI's 16-bit PNG
///   truth/seen_next/N.png                 likewise: 255 where the next left image shows the same point
///   truth/objects.csv                     likewise, after the last frame: SyntheticObject by frame and id
/// Every file appears whole or not at all; existing ones are replaced. `progress(done, frames)` is called after each
/// frame, if given; what it throws ends the sequence there. Throws as SyntheticSequence does, and IoError.
EGOSGM_EXPORT void write_sequence(const SyntheticOptions& options, const std::filesystem::path& folder,
                                  const std::function<void(int done, int frames)>& progress = {});

}  // namespace egosgm::vision
