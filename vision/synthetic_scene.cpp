// SPDX-License-Identifier: Apache-2.0
#include "vision/synthetic_scene.h"

#include <algorithm>
#include <cmath>

namespace egosgm::vision::synthetic {
namespace {

constexpr double kTwoPi = 6.283185307179586;
constexpr double kNodeStep_m = 0.25;
constexpr double kRoadBegin_m = -60;
constexpr int kCrossingFrames = 25,
              kMostRounds = 126;  // of what crosses and of other traffic; then their ids come again
constexpr double kCameraHeight_m = 1.65;
constexpr double kSightBack_m = 40, kSightAhead_m = 600;
constexpr double kFramesPerBend = 60;
constexpr double kSecondBend = 0.37;  // period of the second sine, in periods of the first

double range(uint32_t h, double low, double high) { return low + (high - low) * unit(h); }

/// The scene beyond the last frame must fill the view; it is equal for all sequences of up to 200 m, so that their
/// first frames agree.
double road_end_m(const SyntheticOptions& options) { return std::max(450.0, options.frames * options.speed_m + 250.0); }

}  // namespace

Road::Road(const SyntheticOptions& options, double end_m)
    : curvature_(options.speed_m > 0 ? options.turn_deg * kDegrees / options.speed_m : 0),
      period_m_(options.speed_m > 0 ? kFramesPerBend * options.speed_m : 1),
      phase_(kTwoPi * unit(mix(options.seed, 11))),
      end_m_(end_m) {
  const int count = static_cast<int>(std::ceil((end_m - kRoadBegin_m) / kNodeStep_m)) + 1;
  nodes_.reserve(count);
  double x = 0, z = 0;
  // The origin is s = 0: integrate backwards to the begin first, then forwards from there.
  for (double s = 0; s > kRoadBegin_m; s -= kNodeStep_m) {
    const double middle = heading_rad(s - kNodeStep_m / 2);
    x -= kNodeStep_m * std::sin(middle), z -= kNodeStep_m * std::cos(middle);
  }
  const double z_begin = z;
  for (int i = 0; i < count; ++i) {
    const double s = kRoadBegin_m + i * kNodeStep_m, heading = heading_rad(s);
    nodes_.push_back({x, z, std::sin(heading), std::cos(heading)});
    const double middle = heading_rad(s + kNodeStep_m / 2);
    x += kNodeStep_m * std::sin(middle), z += kNodeStep_m * std::cos(middle);
  }
  size_t i = 0;
  for (double at = z_begin; at < nodes_.back().z; at += 1.0) {
    while (i + 2 < nodes_.size() && nodes_[i + 1].z <= at) ++i;
    const double part = (at - nodes_[i].z) / (nodes_[i + 1].z - nodes_[i].z);
    s_of_z_.push_back(kRoadBegin_m + (i + part) * kNodeStep_m);
  }
}

double Road::heading_rad(double s) const {
  const double w1 = kTwoPi / period_m_, w2 = w1 / kSecondBend;
  return curvature_ * (0.75 / w1 * (1 - std::cos(w1 * s)) + 0.25 / w2 * (std::cos(phase_) - std::cos(w2 * s + phase_)));
}

Road::Node Road::interpolate(double s) const {
  const double at = (s - kRoadBegin_m) / kNodeStep_m;
  const int i = std::clamp(static_cast<int>(std::floor(at)), 0, static_cast<int>(nodes_.size()) - 2);
  const Node &a = nodes_[i], &b = nodes_[i + 1];
  const double part = at - i;
  if (part < 0 || part > 1) {  // straight on beyond the ends
    const Node& end = part < 0 ? a : b;
    const double more = (part < 0 ? part : part - 1) * kNodeStep_m;
    return {end.x + more * end.sin_heading, end.z + more * end.cos_heading, end.sin_heading, end.cos_heading};
  }
  return {a.x + part * (b.x - a.x), a.z + part * (b.z - a.z), a.sin_heading + part * (b.sin_heading - a.sin_heading),
          a.cos_heading + part * (b.cos_heading - a.cos_heading)};
}

Eigen::Vector2d Road::at(double s) const {
  const Node node = interpolate(s);
  return {node.x, node.z};
}

Road::Place Road::locate(double x, double z) const {
  const double row = std::clamp(z - nodes_.front().z, 0.0, static_cast<double>(s_of_z_.size() - 1));
  double s = s_of_z_[static_cast<size_t>(row)];
  Node node = interpolate(s);
  for (int step = 0; step < 2; ++step) {
    s += (x - node.x) * node.sin_heading + (z - node.z) * node.cos_heading;
    node = interpolate(s);
  }
  return {s, (x - node.x) * node.cos_heading - (z - node.z) * node.sin_heading, node.sin_heading, node.cos_heading};
}

Street::Street(const SyntheticOptions& o)
    : options(o), focal_px(0.58 * o.width), road(o, road_end_m(o)), dome_centre(0, 300) {
  const double driven_m = o.frames * o.speed_m;
  if (driven_m > 500) {
    dome_centre = road.at(driven_m / 2);
    dome_radius_m = driven_m / 2 + 350;
  }
  build();
}

void Street::build() {
  for (const int side : {-1, 1}) {
    if (options.plain) {
      add_walls(side, kRoadBegin_m + 10, road.end_m());
      add_poles(side, kRoadBegin_m + 10, road.end_m());
      continue;
    }
    add_houses(side, kRoadBegin_m + 10, road.end_m());
    add_cars(side, kRoadBegin_m + 10, road.end_m());
    add_poles(side, kRoadBegin_m + 10, road.end_m());
    add_trees(side, kRoadBegin_m + 10, road.end_m());
  }
  std::stable_sort(static_solids_.begin(), static_solids_.end(),
                   [](const Solid& a, const Solid& b) { return a.s < b.s; });
}

Solid Street::place(Shape shape, Material material, uint32_t seed, double s, double lateral, double bottom_m,
                    const Eigen::Vector3d& size) const {
  const double heading = road.heading_rad(s), sine = std::sin(heading), cosine = std::cos(heading);
  const Eigen::Vector2d on_road = road.at(s);
  Solid solid;
  solid.shape = shape, solid.material = material, solid.seed = seed, solid.s = s;
  solid.centre = {on_road.x() + lateral * cosine, -bottom_m - size.y() / 2, on_road.y() - lateral * sine};
  solid.half = size / 2;
  solid.sin_heading = sine, solid.cos_heading = cosine;
  return solid;
}

void Street::add_houses(int side, double begin, double end) {
  uint32_t h = mix(options.seed, 100 + side);
  for (double s = begin; s < end;) {
    h = mix(h, 1);
    const double length = range(mix(h, 2), 8, 15), front = range(mix(h, 3), 7.8, 9.6);
    const double storeys = 2 + std::floor(3 * unit(mix(h, 4))), height = 2.9 * storeys + range(mix(h, 5), 0.6, 1.4);
    if (unit(mix(h, 6)) < 0.24) {
      s += range(mix(h, 7), 3, 6);
    } else {
      const Eigen::Vector3d size(10, height, length);
      static_solids_.push_back(
          place(Shape::kBox, Material::kFacade, mix(h, 8), s + length / 2, side * (front + 5), 0, size));
      s += length;
    }
  }
  for (double s = begin; s < end; s += 26) {  // a second row, seen through the gaps
    h = mix(h, 9);
    const Eigen::Vector3d size(8, range(mix(h, 10), 7, 15), 24);
    static_solids_.push_back(
        place(Shape::kBox, Material::kBlock, mix(h, 11), s + 13, side * range(mix(h, 12), 27, 33), 0, size));
  }
}

void Street::add_cars(int side, double begin, double end) {
  uint32_t h = mix(options.seed, 200 + side);
  for (double s = begin; s < end;) {
    h = mix(h, 1);
    const double length = range(mix(h, 2), 3.6, 4.7), lateral = side * range(mix(h, 3), 4.9, 5.1);
    if (unit(mix(h, 4)) < 0.55) {
      const uint32_t seed = mix(h, 5);
      const double body = range(mix(h, 6), 0.8, 0.95), cabin = range(mix(h, 7), 0.5, 0.65);
      static_solids_.push_back(
          place(Shape::kBox, Material::kBody, seed, s + length / 2, lateral, 0, {1.75, body, length}));
      static_solids_.push_back(
          place(Shape::kBox, Material::kCabin, seed, s + length * 0.45, lateral, body, {1.5, cabin, length * 0.55}));
    }
    s += length + range(mix(h, 8), 0.8, 3.5);
  }
}

void Street::add_poles(int side, double begin, double end) {
  uint32_t h = mix(options.seed, 300 + side);
  for (double s = begin; s < end; s += options.pole_spacing_m) {
    h = mix(h, 1);
    if (unit(mix(h, 2)) < 0.1) continue;
    const bool kerbside = unit(mix(h, 3)) < 0.5;
    const double at = s + range(mix(h, 4), 0, 0.7 * options.pole_spacing_m), lateral = side * (kerbside ? 6.2 : 3.9);
    const double height = kerbside ? range(mix(h, 5), 3.0, 6.5) : range(mix(h, 5), 2.2, 3.4);
    const double width = std::min(0.25, options.pole_width_px * range(mix(h, 6), 0.667, 1.333) * 10 / focal_px);
    static_solids_.push_back(
        place(Shape::kCylinder, Material::kPole, mix(h, 7), at, lateral, 0, {width, height, width}));
    if (unit(mix(h, 8)) < 0.35) {
      static_solids_.push_back(
          place(Shape::kBox, Material::kSign, mix(h, 9), at - width, lateral, height - 0.35, {0.6, 0.6, 0.02}));
    }
  }
}

void Street::add_trees(int side, double begin, double end) {
  uint32_t h = mix(options.seed, 400 + side);
  for (double s = begin; s < end; s += 11) {
    h = mix(h, 1);
    if (unit(mix(h, 2)) < 0.5) continue;
    const double at = s + range(mix(h, 3), 0, 7), trunk = range(mix(h, 4), 2.1, 2.9),
                 crown = range(mix(h, 5), 2.2, 3.6);
    const double stem = range(mix(h, 6), 0.2, 0.34);
    static_solids_.push_back(
        place(Shape::kCylinder, Material::kTrunk, mix(h, 7), at, side * 6.7, 0, {stem, trunk + 0.5, stem}));
    for (uint32_t bough = 0; bough < 7; ++bough) {
      h = mix(h, 20 + bough);
      const double size = crown * range(mix(h, 8), 0.45, 0.7), spread = 0.3 * crown;
      static_solids_.push_back(place(Shape::kEllipsoid, Material::kCrown, mix(h, 9),
                                     at + spread * range(mix(h, 10), -1, 1),
                                     side * 6.7 + spread * range(mix(h, 11), -1, 1),
                                     trunk + 0.5 * crown * unit(mix(h, 12)), {size, 0.9 * size, size}));
    }
  }
}

void Street::add_walls(int side, double begin, double end) {
  uint32_t h = mix(options.seed, 500 + side);
  for (double s = begin; s < end;) {
    h = mix(h, 1);
    const double length = range(mix(h, 2), 6, 12), height = range(mix(h, 3), 2.2, 4.5);
    if (unit(mix(h, 4)) < 0.75) {
      const Material material = unit(mix(h, 5)) < 0.6 ? Material::kWall : Material::kBlock;  // the latter has texture
      static_solids_.push_back(place(Shape::kBox, material, mix(h, 6), s + length / 2, side * range(mix(h, 7), 6.8, 9),
                                     0, {0.4, height, length}));
    }
    s += length;
  }
}

Eigen::Isometry3d Street::camera_pose(int frame) const {
  const double s = frame * options.speed_m, w = options.wobble;
  const auto swing = [&](double period, uint32_t which) {
    return w * std::sin(kTwoPi * (frame / period + unit(mix(options.seed, which))));
  };
  const double heading = road.heading_rad(s) + 0.1 * kDegrees * swing(9.1, 21);
  const double pitch = 0.25 * kDegrees * swing(7.3, 22), roll = 0.15 * kDegrees * swing(11.7, 23);
  const double sway = 0.06 * swing(27.0, 24), heave = 0.02 * swing(6.1, 25);
  const Eigen::Vector2d on_road = road.at(s);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() =
      (Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) *
       Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  pose.translation() = Eigen::Vector3d(on_road.x(), -kCameraHeight_m - heave, on_road.y()) +
                       sway * pose.linear() * Eigen::Vector3d::UnitX();
  return pose;
}

std::vector<Solid> Street::solids(int frame) const {
  const double s = frame * options.speed_m;
  const auto before = [](const Solid& solid, double at) { return solid.s < at; };
  const auto first = std::lower_bound(static_solids_.begin(), static_solids_.end(), s - kSightBack_m, before);
  const auto last = std::lower_bound(first, static_solids_.end(), s + kSightAhead_m, before);
  std::vector<Solid> visible(first, last);
  if (options.plain) {
    add_people(frame, visible);
  } else if (options.moving_object) {
    add_moving(frame, visible);
  }
  return visible;
}

void Street::add_moving(int frame, std::vector<Solid>& out) const {
  const double s = frame * options.speed_m, scale = options.moving_object_scale, length = 4.2;
  const double gap = 11 + 2 * std::sin(kTwoPi * frame / 45), weave = 1.2 * std::sin(kTwoPi * frame / 33);
  Solid ahead = place(Shape::kBox, Material::kVan, mix(options.seed, 31), s + gap + length / 2, weave, 0,
                      {1.9 * scale, 1.9 * scale, length});
  ahead.id = 1;
  out.push_back(ahead);

  const int round = frame / kCrossingFrames;
  const double part = static_cast<double>(frame % kCrossingFrames) / kCrossingFrames;
  const int side = (mix(options.seed, 32) + round) % 2 ? 1 : -1;
  add_car(static_cast<uint8_t>(2 + round % kMostRounds), mix(options.seed, 33 + round),
          {s + 10 - 4 * part, side * (-10 + 17 * part), 1.0 * side, 0}, out);
  if (options.traffic) add_traffic(frame, out);
}

void Street::add_traffic(int frame, std::vector<Solid>& out) const {
  const int round = frame / kCrossingFrames, part = frame % kCrossingFrames;
  const double begin = round * kCrossingFrames * options.speed_m;  // where the camera was then
  const auto id = [&](int kind) {
    return static_cast<uint8_t>(2 + kMostRounds + 3 * (round % (kMostRounds / 3)) + kind);
  };
  const uint32_t h = mix(mix(options.seed, 700), static_cast<uint32_t>(round));

  // Oncoming, in the lane to the left.
  const double oncoming_m = range(mix(h, 1), 0.7, 1.1);
  add_car(id(0), mix(h, 2), {begin + 44 - oncoming_m * part, -2.6, 0, -1}, out);

  // Drives ahead, and turns off on an arc.
  const int side = mix(h, 3) % 2 ? 1 : -1;
  const double radius_m = range(mix(h, 4), 5, 8), turned = 50 * kDegrees * part / kCrossingFrames;
  add_car(id(1), mix(h, 5),
          {begin + 22 + radius_m * std::sin(turned), side * (1.4 + radius_m * (1 - std::cos(turned))),
           side * std::sin(turned), std::cos(turned)},
          out);

  // Slow: somebody walks across.
  const double at = begin + range(mix(h, 6), 24, 30), lateral = -side * (3.5 - range(mix(h, 7), 0.08, 0.16) * part);
  add_person(id(2), mix(h, 8), at, lateral, out);
}

void Street::add_car(uint8_t id, uint32_t seed, const OnRoad& where, std::vector<Solid>& out) const {
  Solid body = place(Shape::kBox, Material::kBody, seed, where.s, where.lateral, 0, {1.6, 0.85, 3.4});
  Solid cabin = place(Shape::kBox, Material::kCabin, seed, where.s, where.lateral, 0.85, {1.4, 0.55, 1.9});
  for (Solid* solid : {&body, &cabin}) {
    solid->id = id;
    const double sine = solid->sin_heading, cosine = solid->cos_heading;
    solid->sin_heading = sine * where.cos_turn + cosine * where.sin_turn;
    solid->cos_heading = cosine * where.cos_turn - sine * where.sin_turn;
    out.push_back(*solid);
  }
}

void Street::add_person(uint8_t id, uint32_t seed, double s, double lateral, std::vector<Solid>& out) const {
  Solid body = place(Shape::kEllipsoid, Material::kCloth, mix(seed, 3), s, lateral, 0, {0.5, 1.5, 0.35});
  Solid head = place(Shape::kEllipsoid, Material::kCloth, mix(seed, 4), s, lateral, 1.45, {0.22, 0.28, 0.24});
  for (Solid* solid : {&body, &head}) {
    solid->id = id;
    out.push_back(*solid);
  }
}

void Street::add_people(int frame, std::vector<Solid>& out) const {
  constexpr double kApart_m = 5, kAhead_m = 80;
  const double s = frame * options.speed_m;
  for (int i = std::max(1, static_cast<int>(s / kApart_m)); i * kApart_m < s + kAhead_m; ++i) {
    const uint32_t h = mix(mix(options.seed, 600), static_cast<uint32_t>(i));
    const double phase = 0.2 * (options.moving_object ? frame : 0) + kTwoPi * unit(mix(h, 1));
    const double lateral = (unit(mix(h, 2)) < 0.5 ? -1 : 1) * (3.0 + 0.7 * std::sin(phase));
    add_person(options.moving_object ? static_cast<uint8_t>(1 + i % 255) : 0, h, i * kApart_m, lateral, out);
  }
}

}  // namespace egosgm::vision::synthetic
