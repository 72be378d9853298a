// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/motion.h"
#include "kernels/shared.h"

namespace egosgm::testing {

/// A stereo pair with its true disparities, of both views.
struct ScenePair {
  std::vector<int> greys;        // 16 bits each
  std::vector<float> disparity;  // [px]
  std::vector<bool> is_visible;  // the other view sees it too
};

/// A textured street: a slanted ground, a wall at its end, and boxes on it. The cameras drive ahead along a bend. Both
/// views are rendered by inverse mapping: every pixel's rays are intersected with the surfaces.
class Scene {
 public:
  /// `vertical_offset_px`: how much further down the right image's rows are than the calibration says.
  explicit Scene(shared::ImageSize size, double doffs_px = 0, double vertical_offset_px = 0)
      : size_(size), vertical_offset_px_(vertical_offset_px) {
    const double focal_px = std::max(8.0, 0.8 * size.width);
    calibration_ = {.fx = focal_px,
                    .fy = 0.95 * focal_px,
                    .cx = 0.52 * size.width,
                    .cy = 0.42 * size.height,
                    .baseline_m = 50 / focal_px,
                    .doffs_px = doffs_px};
  }

  const Calibration& calibration() const { return calibration_; }
  shared::ImageSize size() const { return size_; }

  ScenePair frame(int index) const {
    const std::size_t pixels = static_cast<std::size_t>(size_.width) * size_.height;
    ScenePair pair{std::vector<int>(2 * pixels), std::vector<float>(2 * pixels), std::vector<bool>(2 * pixels)};
    for (int view = 0; view < 2; ++view) {
      for (int y = 0; y < size_.height; ++y) {
        for (int x = 0; x < size_.width; ++x) {
          const std::size_t i = view * pixels + static_cast<std::size_t>(y) * size_.width + x;
          const Hit hit = cast(index, view, x, y);
          pair.greys[i] = grey(index, view, x, y);
          pair.disparity[i] = static_cast<float>(disparity_at(hit.depth_m));
          const double match = view == EGOSGM_LEFT ? x - disparity_at(hit.depth_m) : x + disparity_at(hit.depth_m);
          pair.is_visible[i] =
              match >= 0 && match <= size_.width - 1 && cast(index, 1 - view, match, y).depth_m > 0.95 * hit.depth_m;
        }
      }
    }
    return pair;
  }

  /// From the frame before `index` to it.
  Motion motion(int index) const {
    Motion motion;
    motion.current_from_previous = world_from_camera(index).inverse() * world_from_camera(index - 1);
    return motion;
  }

 private:
  struct Hit {
    double depth_m = 0;  // along the camera's axis
    double grey = 0;     // 0 to 1
  };
  struct Box {
    double left_m, right_m, top_m, depth_m;
  };
  static constexpr Box kBoxes[] = {{-3.0, -1.4, -0.6, 5.0}, {0.6, 1.5, 0.1, 3.6}, {-0.7, 0.3, -0.2, 8.0}};
  static constexpr double kGroundM = 1.1, kGroundSlope = -0.02, kWallM = 16;

  static Eigen::Isometry3d world_from_camera(int index) {
    const double yaw = 0.006 * index;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
    pose.translation() = Eigen::Vector3d(0.02 * index, 0.005 * index, 0.15 * index);
    return pose;
  }

  double disparity_at(double depth_m) const {
    return calibration_.fx * calibration_.baseline_m / depth_m - calibration_.doffs_px;
  }

  static double lattice(std::int64_t u, std::int64_t v, std::uint32_t seed) {
    std::uint32_t hash =
        static_cast<std::uint32_t>(u) * 0x9e3779b1u ^ static_cast<std::uint32_t>(v) * 0x85ebca77u ^ seed * 0xc2b2ae3du;
    hash = (hash ^ hash >> 15) * 0x2c1b3c6du;
    hash = (hash ^ hash >> 12) * 0x297a2d39u;
    return (hash ^ hash >> 15) / 4294967295.0;
  }
  static double noise(double u, double v, std::uint32_t seed) {
    const double cell_u = std::floor(u), cell_v = std::floor(v), s = u - cell_u, t = v - cell_v;
    const auto at = [&](int du, int dv) {
      return lattice(static_cast<std::int64_t>(cell_u) + du, static_cast<std::int64_t>(cell_v) + dv, seed);
    };
    return (1 - t) * ((1 - s) * at(0, 0) + s * at(1, 0)) + t * ((1 - s) * at(0, 1) + s * at(1, 1));
  }
  /// Two octaves, the coarser of about six pixels where the surface is `depth_m` away.
  double texture(double u_m, double v_m, double depth_m, std::uint32_t seed) const {
    const double cells_per_m = calibration_.fx / (6 * depth_m);
    return 0.5 * noise(u_m * cells_per_m, v_m * cells_per_m, seed) +
           0.5 * noise(2.6 * u_m * cells_per_m, 2.6 * v_m * cells_per_m, seed + 1);
  }

  Hit cast(int index, int view, double x, double y) const {
    const bool is_right = view == EGOSGM_RIGHT;
    const Eigen::Isometry3d pose = world_from_camera(index);
    const Eigen::Vector3d ray((x - calibration_.cx - (is_right ? calibration_.doffs_px : 0)) / calibration_.fx,
                              (y - calibration_.cy - (is_right ? vertical_offset_px_ : 0)) / calibration_.fy, 1);
    const Eigen::Vector3d eye = pose * Eigen::Vector3d(is_right ? calibration_.baseline_m : 0, 0, 0);
    const Eigen::Vector3d along = pose.linear() * ray;  // its length is the depth

    Hit nearest{(kWallM - eye.z()) / along.z(), 0};
    const Eigen::Vector3d on_wall = eye + nearest.depth_m * along;
    nearest.grey = texture(on_wall.x(), on_wall.y(), kWallM, 3);
    const double ground = (kGroundM + kGroundSlope * eye.z() - eye.y()) / (along.y() - kGroundSlope * along.z());
    if (ground > 0 && ground < nearest.depth_m) {
      const Eigen::Vector3d on_ground = eye + ground * along;
      nearest = {ground, texture(on_ground.x(), 0.6 * on_ground.z(), 3.5, 5)};
    }
    for (const Box& box : kBoxes) {
      const double depth = (box.depth_m - eye.z()) / along.z();
      const Eigen::Vector3d on_box = eye + depth * along;
      const bool hits = on_box.x() > box.left_m && on_box.x() < box.right_m && on_box.y() > box.top_m;
      if (hits && depth > 0 && depth < nearest.depth_m) {
        nearest = {depth, texture(on_box.x(), on_box.y(), box.depth_m, 7)};
      }
    }
    return nearest;
  }

  /// The mean of 3x3 rays.
  int grey(int index, int view, int x, int y) const {
    double sum = 0;
    for (int v = -1; v <= 1; ++v) {
      for (int u = -1; u <= 1; ++u) sum += cast(index, view, x + u / 3.0, y + v / 3.0).grey;
    }
    return static_cast<int>(std::lround(sum / 9 * 65535));
  }

  shared::ImageSize size_;
  double vertical_offset_px_;
  Calibration calibration_;
};

}  // namespace egosgm::testing
