// SPDX-License-Identifier: Apache-2.0
#include "vision/synthetic_render.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "vision/synthetic_texture.h"

namespace egosgm::vision::synthetic {
namespace {

constexpr int kTile_px = 16;
constexpr double kNear_m = 0.05;
constexpr double kVignette = 0.10;   // darkening at the image's corner
constexpr double kRightGain = 0.98;  // of the right camera against the left one
constexpr double kHaze_m = 350;      // distance at which 63 % of the light is the air's
constexpr double kHazeGrey = 205;
constexpr double kPlainSkyGrey = 225;
constexpr double kPlainGround = 0.5;      // reflectance
constexpr double kSameSurface_px = 0.02;  // disparities that differ by less belong to the same point

const Eigen::Vector3d kToSun = Eigen::Vector3d(-0.55, -0.75, -0.5).normalized();

double lambert(const Eigen::Vector3d& normal) { return 0.52 + 0.62 * std::max(0.0, normal.dot(kToSun)); }

Eigen::Vector3d to_local(const Solid& solid, const Eigen::Vector3d& v) {
  return {v.x() * solid.cos_heading - v.z() * solid.sin_heading, v.y(),
          v.x() * solid.sin_heading + v.z() * solid.cos_heading};
}
Eigen::Vector3d to_world(const Solid& solid, const Eigen::Vector3d& v) {
  return {v.x() * solid.cos_heading + v.z() * solid.sin_heading, v.y(),
          -v.x() * solid.sin_heading + v.z() * solid.cos_heading};
}

void meet_box(const Eigen::Vector3d& o, const Eigen::Vector3d& d, const Eigen::Vector3d& half, int index, Hit& best) {
  double enter = kNear_m, leave = best.depth_m;
  int face = -1;
  for (int axis = 0; axis < 3; ++axis) {
    const double inverse = 1 / d[axis], side = std::copysign(half[axis], d[axis]);
    const double in = (-side - o[axis]) * inverse, out = (side - o[axis]) * inverse;
    if (in > enter) enter = in, face = axis;
    leave = std::min(leave, out);
  }
  if (face >= 0 && enter < leave) best = {enter, index, face};
}

/// Nearest root beyond the near plane of |o + t d|^2 = 1, or infinity.
double meet_unit_ball(const Eigen::Vector3d& o, const Eigen::Vector3d& d) {
  const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - 1, root = b * b - a * c;
  if (root < 0) return std::numeric_limits<double>::infinity();
  const double t = (-b - std::sqrt(root)) / a;
  return t > kNear_m ? t : std::numeric_limits<double>::infinity();
}

double gaussian(uint32_t h) {  // sum of twelve uniform numbers, from three hashes of four bytes each
  int sum = 0;
  for (uint32_t i = 0; i < 3; ++i) {
    const uint32_t bits = mix(h + i * 0x632be5abu);
    sum += (bits & 255) + (bits >> 8 & 255) + (bits >> 16 & 255) + (bits >> 24);
  }
  return (sum - 12 * 127.5) / 256.0;
}

}  // namespace

View::View(const Street& street, const std::vector<Solid>& solids, const Camera& camera)
    : street_(street),
      solids_(solids),
      camera_(camera),
      tiles_x_((camera.width + kTile_px - 1) / kTile_px),
      tiles_y_((camera.height + kTile_px - 1) / kTile_px),
      tiles_(static_cast<size_t>(tiles_x_) * tiles_y_) {
  for (size_t i = 0; i < solids.size(); ++i) {
    locals_.push_back({to_local(solids[i], camera.world_from_camera.translation() - solids[i].centre), 0});
    bin(static_cast<int>(i));
  }
  for (auto& tile : tiles_) {
    std::stable_sort(tile.begin(), tile.end(),
                     [&](int a, int b) { return locals_[a].nearest_m < locals_[b].nearest_m; });
  }
}

void View::bin(int index) {
  const Solid& solid = solids_[index];
  const Eigen::Isometry3d camera_from_world = camera_.world_from_camera.inverse();
  Eigen::Vector3d corners[8];
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d sign((i & 1) ? 1 : -1, (i & 2) ? 1 : -1, (i & 4) ? 1 : -1);
    corners[i] = camera_from_world * (solid.centre + to_world(solid, solid.half.cwiseProduct(sign)));
  }
  double x0 = 1e18, x1 = -1e18, y0 = 1e18, y1 = -1e18, nearest = 1e18;
  const auto cover = [&](const Eigen::Vector3d& p) {
    const double x = camera_.cx + camera_.focal_px * p.x() / p.z(), y = camera_.cy + camera_.focal_px * p.y() / p.z();
    x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
    nearest = std::min(nearest, p.z());
  };
  for (int i = 0; i < 8; ++i) {
    const bool ahead = corners[i].z() >= kNear_m;
    if (ahead) cover(corners[i]);
    for (const int bit : {1, 2, 4}) {  // edges cut by the near plane
      const int j = i | bit;
      if (j == i || ahead == (corners[j].z() >= kNear_m)) continue;
      const double part = (kNear_m - corners[i].z()) / (corners[j].z() - corners[i].z());
      Eigen::Vector3d cut = corners[i] + part * (corners[j] - corners[i]);
      cut.z() = kNear_m;
      cover(cut);
    }
  }
  locals_[index].nearest_m = nearest;
  if (x1 < -1 || y1 < -1 || x0 > camera_.width || y0 > camera_.height || nearest > 1e17) return;
  const auto tile = [](double px, int count) {
    return std::clamp(static_cast<int>(std::floor(std::clamp(px, -1e6, 1e6) / kTile_px)), 0, count - 1);
  };
  for (int ty = tile(y0 - 1, tiles_y_); ty <= tile(y1 + 1, tiles_y_); ++ty) {
    for (int tx = tile(x0 - 1, tiles_x_); tx <= tile(x1 + 1, tiles_x_); ++tx) {
      tiles_[static_cast<size_t>(ty) * tiles_x_ + tx].push_back(index);
    }
  }
}

void View::meet(int index, const Eigen::Vector3d& direction, Hit& best) const {
  const Solid& solid = solids_[index];
  const Eigen::Vector3d &o = locals_[index].origin, d = to_local(solid, direction);
  if (solid.shape == Shape::kBox) {
    meet_box(o, d, solid.half, index, best);
  } else if (solid.shape == Shape::kEllipsoid) {
    const double t = meet_unit_ball(o.cwiseQuotient(solid.half), d.cwiseQuotient(solid.half));
    if (t < best.depth_m) best = {t, index, 0};
  } else {  // a cylinder without caps: all are taller than the camera is high, and stand on the ground
    const Eigen::Vector3d flat(1 / solid.half.x(), 0, 1 / solid.half.z());
    const double t = meet_unit_ball(o.cwiseProduct(flat), d.cwiseProduct(flat));
    if (t < best.depth_m && std::abs(o.y() + t * d.y()) <= solid.half.y()) best = {t, index, 0};
  }
}

Hit View::cast(double x, double y) const {
  const Eigen::Vector3d direction = camera_.ray(x, y), &origin = camera_.world_from_camera.translation();
  const int tx = std::clamp(static_cast<int>(x) / kTile_px, 0, tiles_x_ - 1);
  const int ty = std::clamp(static_cast<int>(y) / kTile_px, 0, tiles_y_ - 1);
  Hit best{std::numeric_limits<double>::infinity(), Hit::kSky, 0};
  if (direction.y() > 0) best = {-origin.y() / direction.y(), Hit::kGround, 1};
  for (const int index : tiles_[static_cast<size_t>(ty) * tiles_x_ + tx]) {
    if (locals_[index].nearest_m > best.depth_m) break;
    meet(index, direction, best);
  }
  if (street_.options.plain || best.depth_m < 0.25 * street_.dome_radius_m) return best;
  // The camera is inside of the dome: the far root.
  const Eigen::Vector3d o = origin - Eigen::Vector3d(street_.dome_centre.x(), 0, street_.dome_centre.y());
  const double a = direction.squaredNorm(), b = o.dot(direction), r = street_.dome_radius_m;
  const double dome = (-b + std::sqrt(b * b + a * (r * r - o.squaredNorm()))) / a;
  if (dome < best.depth_m) best = {dome, Hit::kSky, 0};
  return best;
}

double View::shade_ground(const Eigen::Vector3d& point, const Eigen::Vector3d& direction, double pixel_m) const {
  if (street_.options.plain) return kPlainGround * lambert(-Eigen::Vector3d::UnitY());
  const Road::Place place = street_.road.locate(point.x(), point.z());
  const double length = std::hypot(direction.x(), direction.z());
  const double across = std::abs(direction.x() * place.cos_heading - direction.z() * place.sin_heading) / length;
  const double along = std::abs(direction.x() * place.sin_heading + direction.z() * place.cos_heading) / length;
  const double grazing_m = pixel_m * length / std::max(1e-6, std::abs(direction.y()));
  return road_reflectance({place.lateral, place.s, pixel_m + across * grazing_m, pixel_m + along * grazing_m},
                          street_.options.seed) *
         lambert(-Eigen::Vector3d::UnitY());
}

double View::shade_sky(const Eigen::Vector3d& point) const {
  const double r = street_.dome_radius_m, x = point.x() - street_.dome_centre.x(),
               z = point.z() - street_.dome_centre.y();
  const double pixel_m = 600 / camera_.focal_px;  // on a dome scaled to 600 m, which looks the same from its middle
  return sky_brightness(
      {600 * std::atan2(x, z), -600 * std::asin(std::clamp(point.y() / r, -1.0, 1.0)), pixel_m, pixel_m},
      street_.options.seed);
}

double View::shade_solid(const Hit& hit, const Eigen::Vector3d& direction, double pixel_m) const {
  const Solid& solid = solids_[hit.solid];
  const Eigen::Vector3d d = to_local(solid, direction), p = locals_[hit.solid].origin + hit.depth_m * d;
  const double up = solid.half.y() - p.y();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  SurfacePoint at{0, up, pixel_m, pixel_m};
  if (solid.shape == Shape::kBox) {
    normal[hit.face] = -std::copysign(1.0, d[hit.face]);
    const double stretch = d.norm() / std::max(1e-3, std::abs(d[hit.face]));
    if (hit.face == 1) {
      at = {p.x(), p.z(), pixel_m * stretch, pixel_m * stretch};
    } else {
      at.u = hit.face == 0 ? p.z() : p.x();
      at.du = pixel_m * stretch;
    }
  } else {
    const double y = solid.shape == Shape::kEllipsoid ? p.y() / (solid.half.y() * solid.half.y()) : 0;
    normal = Eigen::Vector3d(p.x() / (solid.half.x() * solid.half.x()), y, p.z() / (solid.half.z() * solid.half.z()));
    normal.normalize();
    at.u = solid.half.x() * std::atan2(p.x(), -p.z());
  }
  return solid_reflectance(solid, hit.face, at) * lambert(to_world(solid, normal));
}

double View::shade(double x, double y, const Hit& hit) const {
  if (hit.solid == Hit::kSky && street_.options.plain) return kPlainSkyGrey;
  const Eigen::Vector3d direction = camera_.ray(x, y);
  const Eigen::Vector3d point = camera_.world_from_camera.translation() + hit.depth_m * direction;
  const double pixel_m = hit.depth_m / camera_.focal_px;
  if (hit.solid == Hit::kSky) return 255 * shade_sky(point);
  const double light =
      hit.solid == Hit::kGround ? shade_ground(point, direction, pixel_m) : shade_solid(hit, direction, pixel_m);
  const double air = 1 - std::exp(-hit.depth_m / kHaze_m);
  return 235 * light * (1 - air) + kHazeGrey * air;
}

namespace {

/// Mean over a pixel's grid of rays. Where the outermost four and the centre meet one surface, those four are enough:
/// textures are band-limited already. `centre` is the ray that gave the disparity.
double pixel_radiance(const View& view, int x, int y, const Hit& centre, int rays) {
  const double outermost = 0.5 - 0.5 / rays;
  if (rays > 2) {
    double sum = 0;
    bool one_surface = true;
    for (int corner = 0; corner < 4 && one_surface; ++corner) {
      const double px = x + (corner & 1 ? outermost : -outermost), py = y + (corner & 2 ? outermost : -outermost);
      const Hit hit = view.cast(px, py);
      one_surface = hit.solid == centre.solid && hit.face == centre.face;
      if (one_surface) sum += view.shade(px, py, hit);
    }
    if (one_surface) return sum / 4;
  }
  double sum = 0;
  for (int j = 0; j < rays; ++j) {
    for (int i = 0; i < rays; ++i) {
      const double px = x + static_cast<double>(i) / rays - outermost,
                   py = y + static_cast<double>(j) / rays - outermost;
      sum += view.shade(px, py, view.cast(px, py));
    }
  }
  return sum / (rays * rays);
}

uint8_t expose(double radiance, const Camera& camera, int x, int y, double gain, uint32_t noise_seed, double sigma) {
  const double rx = (x - camera.cx) / (0.5 * camera.width), ry = (y - camera.cy) / (0.5 * camera.height);
  const double vignette = 1 - kVignette * 0.5 * (rx * rx + ry * ry);
  const double noise = sigma * gaussian(mix(noise_seed, static_cast<uint32_t>(y) * 65536u + static_cast<uint32_t>(x)));
  return static_cast<uint8_t>(std::clamp(std::lround(radiance * gain * vignette + noise), 0l, 255l));
}

struct ViewMaps {
  Image &image, &disparity, &noc, &moving;
};

/// `towards_other`: -1 where the other camera is the right one (x_right = x_left - d), 1 where it is the left one.
void render_view(const View& view, const View& other, int towards_other, const std::vector<Solid>& solids,
                 const SyntheticOptions& options, uint32_t noise_seed, ViewMaps out) {
  const Camera& camera = view.camera();
  const Size size{camera.width, camera.height};
  const double numerator = camera.focal_px * kBaseline_m,
               gain = options.exposure * (towards_other > 0 ? kRightGain : 1);
  out.image.create(size, kU8), out.disparity.create(size, kF32);
  out.noc.create(size, kU8), out.moving.create(size, kU8);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Hit hit = view.cast(x, y);
      const double d = numerator / hit.depth_m, there = x + towards_other * d;
      const bool inside = there >= -0.5 && there < camera.width - 0.5;
      const bool seen = inside && numerator / other.cast(there, y).depth_m <= d + kSameSurface_px;
      out.disparity.at<float>(y, x) = static_cast<float>(d);
      out.noc.at<uint8_t>(y, x) = seen ? 255 : 0;
      out.moving.at<uint8_t>(y, x) = hit.solid >= 0 && solids[hit.solid].id ? 255 : 0;
      out.image.at<uint8_t>(y, x) = expose(pixel_radiance(view, x, y, hit, options.supersampling), camera, x, y, gain,
                                           noise_seed, options.noise_grey);
    }
  }
}

}  // namespace

Camera left_camera(const Street& street, int frame) {
  const int width = street.options.width, height = street.options.height;
  return {street.camera_pose(frame), street.focal_px, 0.5 * (width - 1), 0.46 * (height - 1), width, height};
}

void render_pair(const Street& street, int frame, SyntheticFrame& out) {
  const std::vector<Solid> solids = street.solids(frame);
  const Camera left = left_camera(street, frame);
  Camera right = left;
  right.world_from_camera.translation() += left.world_from_camera.linear() * Eigen::Vector3d(kBaseline_m, 0, 0);
  const View left_view(street, solids, left), right_view(street, solids, right);
  const uint32_t seed = mix(mix(street.options.seed, 71), static_cast<uint32_t>(frame));
  render_view(left_view, right_view, -1, solids, street.options, mix(seed, 0),
              {out.left, out.left_disparity, out.left_noc, out.left_moving});
  render_view(right_view, left_view, 1, solids, street.options, mix(seed, 1),
              {out.right, out.right_disparity, out.right_noc, out.right_moving});
}

namespace {

Eigen::Isometry3d world_from_solid(const Solid& solid) {
  Eigen::Isometry3d pose(Eigen::Translation3d(solid.centre));
  for (int axis = 0; axis < 3; ++axis) pose.linear().col(axis) = to_world(solid, Eigen::Vector3d::Unit(axis));
  return pose;
}

/// What moves by itself and is there at both times, by its id; boxes are empty.
std::map<int, SyntheticObject> find_objects(const std::vector<Solid>& solids, const std::vector<Solid>& next_solids,
                                            const Camera& camera, const Camera& next) {
  std::map<int, SyntheticObject> objects;
  for (auto solid = solids.begin(); solid != solids.end(); ++solid) {
    const auto is_same = [&](const Solid& other) { return other.id == solid->id; };
    const auto then = std::find_if(next_solids.begin(), next_solids.end(), is_same);
    if (solid->id == 0 || objects.count(solid->id) || then == next_solids.end()) continue;
    double top = std::numeric_limits<double>::infinity(), bottom = -top;
    for (auto part = solid; part != solids.end(); ++part) {
      if (!is_same(*part)) continue;
      top = std::min(top, part->centre.y() - part->half.y());
      bottom = std::max(bottom, part->centre.y() + part->half.y());
    }
    const Eigen::Vector3d centre(solid->centre.x(), 0.5 * (top + bottom), solid->centre.z());
    const Eigen::Isometry3d motion = world_from_solid(*then) * world_from_solid(*solid).inverse(),
                            camera_from_world = camera.world_from_camera.inverse();
    SyntheticObject& object = objects[solid->id];
    object.id = solid->id;
    object.left = camera.width, object.top = camera.height;
    object.centre_m = camera_from_world * centre;
    object.velocity_m = camera_from_world.linear() * (motion * centre - centre);
    object.next_from_current = next.world_from_camera.inverse() * motion * camera.world_from_camera;
  }
  return objects;
}

}  // namespace

void find_scene_flow(const Street& street, int frame, SyntheticSceneFlow& out) {
  const std::vector<Solid> solids = street.solids(frame), next_solids = street.solids(frame + 1);
  const Camera camera = left_camera(street, frame), next = left_camera(street, frame + 1);
  const View view(street, solids, camera), next_view(street, next_solids, next);
  const double numerator = camera.focal_px * kBaseline_m;
  const Isometry of_camera = next.world_from_camera.inverse() * camera.world_from_camera;
  std::map<int, SyntheticObject> objects = find_objects(solids, next_solids, camera, next);
  const Size size{camera.width, camera.height};
  out.flow = Image(size, kFlow, std::numeric_limits<float>::quiet_NaN());
  out.next_disparity = Image(size, kF32, kInvalidDisparity);
  out.seen_next = Image(size, kU8, 0), out.objects = Image(size, kU8, 0);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Hit hit = view.cast(x, y);
      const uint8_t id = hit.solid >= 0 ? solids[hit.solid].id : 0;
      out.objects.at<uint8_t>(y, x) = id;
      const auto object = objects.find(id);
      if (id && object == objects.end()) continue;
      if (id) {
        SyntheticObject& o = object->second;
        o.left = std::min(o.left, x), o.right = std::max(o.right, x);
        o.top = std::min(o.top, y), o.bottom = std::max(o.bottom, y);
      }
      const Isometry& motion = id ? object->second.next_from_current : of_camera;
      const Eigen::Vector3d ray((x - camera.cx) / camera.focal_px, (y - camera.cy) / camera.focal_px, 1);
      const Eigen::Vector3d there = motion.linear() * ray + motion.translation() / hit.depth_m;  // by the depth
      if (there.z() <= 0) continue;
      const double next_x = camera.cx + camera.focal_px * there.x() / there.z(),
                   next_y = camera.cy + camera.focal_px * there.y() / there.z(),
                   d = numerator / (hit.depth_m * there.z());
      float* flow = out.flow.row<float>(y) + 2 * x;
      flow[0] = static_cast<float>(next_x - x), flow[1] = static_cast<float>(next_y - y);
      out.next_disparity.at<float>(y, x) = static_cast<float>(d);
      const bool inside = next_x >= -0.5 && next_x < size.width - 0.5 && next_y >= -0.5 && next_y < size.height - 0.5;
      const bool seen = inside && numerator / next_view.cast(next_x, next_y).depth_m <= d + kSameSurface_px;
      out.seen_next.at<uint8_t>(y, x) = seen ? 255 : 0;
    }
  }
  for (const auto& [id, object] : objects) {
    if (object.right >= 0) out.moving.push_back(object);
  }
}

}  // namespace egosgm::vision::synthetic
