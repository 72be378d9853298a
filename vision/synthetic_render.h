// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "vision/synthetic_scene.h"

namespace egosgm::vision::synthetic {

/// A pinhole camera in the world frame, pixel centres at integers.
struct Camera {
  Eigen::Isometry3d world_from_camera;
  double focal_px, cx, cy;
  int width, height;

  /// Direction whose component along the optical axis is 1: a ray's parameter is the depth.
  Eigen::Vector3d ray(double x, double y) const {
    return world_from_camera.linear() * Eigen::Vector3d((x - cx) / focal_px, (y - cy) / focal_px, 1);
  }
};

/// The first hit of a ray: a solid (index >= 0), the ground or the sky, at `depth_m` along the optical axis, which is
/// infinite in the sky of a plain street.
struct Hit {
  static constexpr int kGround = -1, kSky = -2;
  double depth_m;
  int solid;
  int face;  // of a box: the axis of its normal (across, up, along)
};

/// One camera's view of a street at one time; solids are sorted into image tiles. Const calls are thread-safe.
class View {
 public:
  /// REQUIRES: `street` and `solids` outlive the view.
  View(const Street& street, const std::vector<Solid>& solids, const Camera& camera);

  /// REQUIRES: (x, y) lies within half a pixel of the image.
  Hit cast(double x, double y) const;
  /// Radiance 0..255 of the point that was hit, without noise and vignetting.
  double shade(double x, double y, const Hit& hit) const;
  const Camera& camera() const { return camera_; }

 private:
  struct Local {  // a solid as this camera sees it
    Eigen::Vector3d origin;
    double nearest_m;
  };
  void bin(int index);
  void meet(int index, const Eigen::Vector3d& direction, Hit& best) const;
  double shade_ground(const Eigen::Vector3d& point, const Eigen::Vector3d& direction, double pixel_m) const;
  double shade_sky(const Eigen::Vector3d& point) const;
  double shade_solid(const Hit& hit, const Eigen::Vector3d& direction, double pixel_m) const;

  const Street& street_;
  const std::vector<Solid>& solids_;
  Camera camera_;
  std::vector<Local> locals_;
  int tiles_x_, tiles_y_;
  std::vector<std::vector<int>> tiles_;  // nearest first
};

/// Fills all maps of a frame but the pose.
void render_pair(const Street& street, int frame, SyntheticFrame& out);

/// Fills all of it.
void find_scene_flow(const Street& street, int frame, SyntheticSceneFlow& out);

Camera left_camera(const Street& street, int frame);
inline constexpr double kBaseline_m = 0.54;

}  // namespace egosgm::vision::synthetic
