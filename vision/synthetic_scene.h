// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "egosgm/vision/synthetic.h"

namespace egosgm::vision::synthetic {

// World frame: x right, y down, z forward, metres; the ground is y = 0 and the road starts at the origin along z.

inline constexpr double kDegrees = 0.017453292519943295;

/// Integer hash with full avalanche (constants of the "lowbias32" family found by hill climbing).
inline uint32_t mix(uint32_t h) {
  h ^= h >> 16;
  h *= 0x7feb352du;
  h ^= h >> 15;
  h *= 0x846ca68bu;
  return h ^ (h >> 16);
}
inline uint32_t mix(uint32_t a, uint32_t b) { return mix(a * 0x9e3779b1u + mix(b)); }
/// Uniform in [0, 1).
inline double unit(uint32_t h) { return h * (1.0 / 4294967296.0); }

/// The road's centre line by arc length s: x' = sin(heading), z' = cos(heading), the heading a sum of two sines.
class Road {
 public:
  Road(const SyntheticOptions& options, double end_m);

  double heading_rad(double s) const;
  Eigen::Vector2d at(double s) const;  // (x, z)
  double end_m() const { return end_m_; }

  struct Place {
    double s, lateral;  // arc length; metres to the right of the centre line
    double sin_heading, cos_heading;
  };
  /// Foot of the perpendicular, by two Newton steps from the node of equal z.
  Place locate(double x, double z) const;

 private:
  struct Node {
    double x, z, sin_heading, cos_heading;
  };
  Node interpolate(double s) const;

  double curvature_, period_m_, phase_, end_m_;
  std::vector<Node> nodes_;
  std::vector<double> s_of_z_;
};

enum class Shape : uint8_t { kBox, kCylinder, kEllipsoid };
enum class Material : uint8_t { kFacade, kBlock, kBody, kCabin, kVan, kPole, kSign, kTrunk, kCrown, kWall, kCloth };

/// A solid with a vertical axis: `half` is its half extent across, up and along its heading.
struct Solid {
  Shape shape;
  Material material;
  uint8_t id = 0;  // of what moves by itself; the solids of one share it, stand on each other and turn together
  uint32_t seed;
  Eigen::Vector3d centre;
  Eigen::Vector3d half;
  double sin_heading, cos_heading;
  double s;  // place along the road, for culling
};

/// Everything that is in the world, and where the camera is.
struct Street {
  explicit Street(const SyntheticOptions& options);

  /// Left camera's pose in the world frame (not yet relative to frame 0).
  Eigen::Isometry3d camera_pose(int frame) const;
  /// The solids that can be seen from the camera of `frame`, the moving ones where they are at that time.
  std::vector<Solid> solids(int frame) const;

  SyntheticOptions options;
  double focal_px;
  Road road;
  Eigen::Vector2d dome_centre;  // (x, z); its height is 0
  double dome_radius_m = 600;

 private:
  void build();
  void add_houses(int side, double begin, double end);
  void add_cars(int side, double begin, double end);
  void add_poles(int side, double begin, double end);
  void add_trees(int side, double begin, double end);
  void add_walls(int side, double begin, double end);
  Solid place(Shape shape, Material material, uint32_t seed, double s, double lateral, double bottom_m,
              const Eigen::Vector3d& size) const;
  void add_moving(int frame, std::vector<Solid>& out) const;
  void add_traffic(int frame, std::vector<Solid>& out) const;
  void add_people(int frame, std::vector<Solid>& out) const;
  /// A place on the road, and a turn to the right against its heading.
  struct OnRoad {
    double s, lateral, sin_turn, cos_turn;
  };
  void add_car(uint8_t id, uint32_t seed, const OnRoad& where, std::vector<Solid>& out) const;
  void add_person(uint8_t id, uint32_t seed, double s, double lateral, std::vector<Solid>& out) const;

  std::vector<Solid> static_solids_;  // by s
};

}  // namespace egosgm::vision::synthetic
