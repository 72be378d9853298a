// SPDX-License-Identifier: Apache-2.0
#include "vision/rigid_alignment.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "egosgm/vision/evaluation.h"
#include "host/cpu_clones.h"
#include "host/odometry/geometry.h"
#include "host/quantile.h"
#include "vision/image_values.h"
#include "vision/no_value.h"

namespace egosgm::vision {
namespace {

using odometry::Matrix6;
using odometry::Vector6;

constexpr int kMeanRadius = 7;                 // px of a level: what is darker or brighter all around says nothing
constexpr int kRounds = 6;                     // at each level
constexpr double kTurnSigma = 3 * M_PI / 180;  // an object turns by itself, in a frame
constexpr double kPointsOfTurn = 60;           // points for which that counts once
constexpr double kCauchyScale2 = 4;
constexpr double kFarDisparity_px = 3;  // a map farther off than this sees another surface
constexpr double kSettled2 = 0.01;      // a squared step in standard deviations of the estimate
constexpr std::size_t kMinPoints = 20;

/// Grey values without the mean of the square around them. The image repeats its border.
Image without_local_mean(const Image& grey) {
  constexpr int kSide = 2 * kMeanRadius + 1;
  constexpr float kPart = 1.0f / (kSide * kSide);
  const int width = grey.cols, last = grey.rows - 1;
  Image result(grey.size(), kF32);
  std::vector<float> columns(static_cast<std::size_t>(width + 2 * kMeanRadius), 0);  // sums of kSide rows
  const auto add = [&](int y, float sign) {
    const float* row = grey.row<float>(std::clamp(y, 0, last));
    float* sums = columns.data() + kMeanRadius;
    for (int x = 0; x < width; ++x) sums[x] += sign * row[x];
  };
  for (int y = -kMeanRadius; y < kMeanRadius; ++y) add(y, 1);
  for (int y = 0; y < grey.rows; ++y) {
    add(y + kMeanRadius, 1);
    for (int i = 0; i < kMeanRadius; ++i) {
      columns[static_cast<std::size_t>(i)] = columns[kMeanRadius];
      columns[static_cast<std::size_t>(width + kMeanRadius + i)] =
          columns[static_cast<std::size_t>(width + kMeanRadius - 1)];
    }
    const float* values = grey.row<float>(y);
    float* to = result.row<float>(y);
    float sum = 0;
    for (int i = 0; i < kSide - 1; ++i) sum += columns[static_cast<std::size_t>(i)];
    for (int x = 0; x < width; ++x) {
      sum += columns[static_cast<std::size_t>(x + kSide - 1)];
      to[x] = values[x] - kPart * sum;
      sum -= columns[static_cast<std::size_t>(x)];
    }
    add(y - kMeanRadius, -1);
  }
  return result;
}

Image halved(const Image& grey) {
  Image half({grey.cols / 2, grey.rows / 2}, kF32);
  for (int y = 0; y < half.rows; ++y) {
    const float *upper = grey.row<float>(2 * y), *lower = grey.row<float>(2 * y + 1);
    for (int x = 0; x < half.cols; ++x) {
      half.at<float>(y, x) = 0.25f * (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]);
    }
  }
  return half;
}

/// A coordinate of the full resolution at a level.
double at_level(double full, int level) { return (full + 0.5) / (1 << level) - 0.5; }

struct Sample {
  double value, by_u, by_v;
};

/// Bilinear, with its derivative; none outside.
inline std::optional<Sample> sample(const Image& image, double u, double v) {
  const double x0 = std::floor(u), y0 = std::floor(v);
  if (!(x0 >= 0 && y0 >= 0 && x0 + 1 < image.cols && y0 + 1 < image.rows)) return std::nullopt;
  const int x = static_cast<int>(x0), y = static_cast<int>(y0);
  const double s = u - x0, t = v - y0;
  const float *upper = image.row<float>(y) + x, *lower = image.row<float>(y + 1) + x;
  const double top = upper[0] + s * (upper[1] - upper[0]), bottom = lower[0] + s * (lower[1] - lower[0]);
  return Sample{top + t * (bottom - top), (1 - t) * (upper[1] - upper[0]) + t * (lower[1] - lower[0]), bottom - top};
}

/// The disparity there: of a smooth surface bilinear with its slope, else the nearest one, which has none.
std::optional<Sample> sample_disparity(const Image& disparity, double u, double v) {
  const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
  if (x < 0 || y < 0 || x >= disparity.cols || y >= disparity.rows) return std::nullopt;
  const float nearest = disparity.at<float>(y, x);
  if (!(nearest > kInvalidDisparity)) return std::nullopt;
  const int x0 = std::clamp(static_cast<int>(std::floor(u)), 0, std::max(0, disparity.cols - 2));
  const int y0 = std::clamp(static_cast<int>(std::floor(v)), 0, std::max(0, disparity.rows - 2));
  if (disparity.cols > 1 && disparity.rows > 1) {
    const float *upper = disparity.row<float>(y0) + x0, *lower = disparity.row<float>(y0 + 1) + x0;
    const float least = std::min({upper[0], upper[1], lower[0], lower[1]});
    const float most = std::max({upper[0], upper[1], lower[0], lower[1]});
    if (least > kInvalidDisparity && most - least < 1) {
      if (const std::optional<Sample> smooth = sample(disparity, u, v)) return smooth;
    }
  }
  return Sample{nearest, 0, 0};
}

/// Two rows of pixels, and where between four of them.
struct RowPair {
  const float *upper, *lower;
  float s, t;
};

EGOSGM_CPU_CLONES
void add_differences(const RowPair rows, float grey, float most, int count, float* __restrict sums) {
  for (int x = 0; x < count; ++x) {
    const float top = rows.upper[x] + rows.s * (rows.upper[x + 1] - rows.upper[x]);
    const float bottom = rows.lower[x] + rows.s * (rows.lower[x + 1] - rows.lower[x]);
    const float apart = std::abs(top + rows.t * (bottom - top) - grey);
    sums[x] += apart < most ? apart : most;
  }
}

/// A small translation and rotation `step` about `centre`, after `motion`.
Eigen::Isometry3d turned_about(const Eigen::Vector3d& centre, const Vector6& step, const Eigen::Isometry3d& motion) {
  const Eigen::Vector3d turn = step.tail<3>();
  const double angle = turn.norm();
  const Eigen::AngleAxisd rotation(angle, angle > 0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d::UnitX());
  Eigen::Isometry3d moved =
      Eigen::Translation3d(centre + step.head<3>()) * rotation * Eigen::Translation3d(-centre) * motion;
  moved.linear() = Eigen::Quaterniond(moved.linear()).normalized().toRotationMatrix();
  return moved;
}

struct Equations {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();

  void add(const Vector6& by_twist, double residual, double sigma) {
    const double scaled = residual / sigma;
    const double weight = odometry::cauchy_weight(scaled * scaled, kCauchyScale2) / (sigma * sigma);
    information.noalias() += (weight * by_twist) * by_twist.transpose();
    gradient.noalias() += weight * residual * by_twist;
  }
};

}  // namespace

AlignedView make_view(const Image& left, const Image& disparity) {
  AlignedView view;
  Image grey = as_floats(left);
  if (left.type == kU16) {
    visit_values(grey, [](auto& value) { value /= 256; });
  }
  for (int level = 0; level < AlignedView::kLevels; ++level) {
    if (level > 0) grey = halved(grey);
    view.greys[level] = without_local_mean(grey);
  }
  view.disparity = disparity.clone();
  view.filled = interpolate_background(disparity);
  return view;
}

std::optional<RigidFit> align_rigidly(const Calibration& calibration, const AlignedView& from, const AlignedView& to,
                                      const std::vector<SurfacePoint>& points, const Eigen::Isometry3d& start,
                                      const AlignmentNoise& noise) {
  if (points.size() < kMinPoints) return std::nullopt;
  RigidFit fit;
  fit.motion = start;
  std::vector<double> greys(points.size());
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const SurfacePoint& point : points) middle += point.point_m / static_cast<double>(points.size());
  for (int level = AlignedView::kLevels; level-- > 0;) {
    if (to.greys[level].empty()) continue;
    const double scale = 1.0 / (1 << level);
    const std::size_t step = std::size_t{1} << level;  // fewer points where pixels are large
    for (std::size_t i = 0; i < points.size(); i += step) {
      const auto grey = sample(from.greys[level], at_level(points[i].u, level), at_level(points[i].v, level));
      greys[i] = grey ? grey->value : kNoValue;
    }
    for (int round = 0; round < kRounds; ++round) {
      fit.centre_m = fit.motion * middle;
      Equations equations;
      std::size_t asked = 0, agree = 0;
      for (std::size_t i = 0; i < points.size(); i += step) {
        const Eigen::Vector3d moved = fit.motion * points[i].point_m;
        if (!(moved.z() > odometry::kMinDepth_m) || !has_value(greys[i])) continue;
        const Eigen::Vector3d seen = odometry::project(calibration, moved);
        const Eigen::Matrix3d by_point = odometry::projection_jacobian(calibration, moved);
        const Eigen::Vector3d arm = moved - fit.centre_m;
        const auto by_twist = [&](const Eigen::Vector3d& of_pixel) {
          const Eigen::Vector3d of_point = by_point.transpose() * of_pixel;
          return (Vector6() << of_point, arm.cross(of_point)).finished();
        };
        const auto grey = sample(to.greys[level], at_level(seen.x(), level), at_level(seen.y(), level));
        if (!grey) continue;
        const auto disparity = sample_disparity(to.disparity, seen.x(), seen.y());
        const double apart = disparity ? disparity->value - seen.z() : 0;
        if (apart > kFarDisparity_px + 0.05 * seen.z()) continue;  // something nearer hides it
        ++asked;
        const double different = grey->value - greys[i];
        equations.add(by_twist({scale * grey->by_u, scale * grey->by_v, 0}), -different, noise.grey);
        bool agrees = std::abs(different) < 3 * noise.grey;
        if (disparity && std::abs(apart) < kFarDisparity_px) {
          equations.add(by_twist({-disparity->by_u, -disparity->by_v, 1}), apart, noise.disparity_px);
        }
        if (disparity) agrees = agrees && std::abs(apart) < 3 * noise.disparity_px;
        agree += agrees;
      }
      if (asked < kMinPoints) return std::nullopt;
      fit.share = static_cast<double>(agree) / static_cast<double>(asked);
      const Eigen::AngleAxisd turn(fit.motion.linear() * start.linear().transpose());
      const double prior = std::max(1.0, static_cast<double>(asked) / kPointsOfTurn) / (kTurnSigma * kTurnSigma);
      equations.information.bottomRightCorner<3, 3>().diagonal().array() += prior;
      equations.gradient.tail<3>() -= prior * turn.angle() * turn.axis();
      equations.information.diagonal().array() += 1e-9;
      const Eigen::LDLT<Matrix6, Eigen::Lower> solver(equations.information);
      const Vector6 twist = solver.solve(equations.gradient);
      if (!twist.allFinite()) return std::nullopt;
      fit.motion = turned_about(fit.centre_m, twist, fit.motion);
      fit.covariance = solver.solve(Matrix6::Identity());
      if (twist.dot(equations.gradient) < kSettled2) break;
    }
  }
  return fit;
}

Eigen::Isometry3d best_shift(const Calibration& calibration, const AlignedView& from, const AlignedView& to,
                             const std::vector<SurfacePoint>& points, const Eigen::Isometry3d& camera,
                             const AlignmentNoise& noise) {
  constexpr int kLevel = AlignedView::kLevels - 1, kRadiusX = 14,
                kRadiusY = 7;  // places of a quarter of the resolution
  const Image &own = from.greys[kLevel], &other = to.greys[kLevel];
  struct Place {
    float u, v, grey;
  };
  std::vector<Place> places;
  const std::size_t step = std::max<std::size_t>(1, points.size() / 100);
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3d moved = camera * points[i].point_m;
    if (!(moved.z() > odometry::kMinDepth_m)) continue;
    const Eigen::Vector3d seen = odometry::project(calibration, moved);
    const auto grey = sample(own, at_level(points[i].u, kLevel), at_level(points[i].v, kLevel));
    if (grey)
      places.push_back({static_cast<float>(at_level(seen.x(), kLevel)), static_cast<float>(at_level(seen.y(), kLevel)),
                        static_cast<float>(grey->value)});
  }
  const auto most = static_cast<float>(6 * noise.grey);
  constexpr int kWidth = 2 * kRadiusX + 1, kHeight = 2 * kRadiusY + 1;
  std::array<std::array<float, kWidth>, kHeight> sums{};
  for (const Place& place : places) {
    const int left = static_cast<int>(std::floor(place.u)) - kRadiusX;
    const int top = static_cast<int>(std::floor(place.v)) - kRadiusY;
    const float s = place.u - std::floor(place.u), t = place.v - std::floor(place.v);
    // Columns whose four pixels lie in the image; all others count as most.
    const int first = std::clamp(-left, 0, kWidth), end = std::clamp(other.cols - 1 - left, first, kWidth);
    for (int y = 0; y < kHeight; ++y) {
      float* row = sums[static_cast<std::size_t>(y)].data();
      const bool is_inside = top + y >= 0 && top + y + 1 < other.rows;
      const int begin = is_inside ? first : kWidth, stop = is_inside ? end : kWidth;
      for (int x = 0; x < begin; ++x) row[x] += most;
      for (int x = stop; x < kWidth; ++x) row[x] += most;
      if (begin == stop) continue;
      const int column = left + begin;
      add_differences({other.row<float>(top + y) + column, other.row<float>(top + y + 1) + column, s, t}, place.grey,
                      most, stop - begin, row + begin);
    }
  }
  float best = INFINITY;
  int best_x = 0, best_y = 0;
  for (int y = -kRadiusY; y <= kRadiusY; ++y) {
    for (int x = -kRadiusX; x <= kRadiusX; ++x) {
      const float of_distance = 1 + 0.002f * static_cast<float>(x * x + y * y);  // near places, where none is better
      const float sum =
          of_distance * sums[static_cast<std::size_t>(y + kRadiusY)][static_cast<std::size_t>(x + kRadiusX)];
      if (sum >= best) continue;
      best = sum;
      best_x = x;
      best_y = y;
    }
  }
  // The shift in space: of the middle of the points, at the disparity that most of them have there.
  std::vector<double> changes;
  std::vector<Eigen::Vector3d> moved_points;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3d moved = camera * points[i].point_m;
    if (!(moved.z() > odometry::kMinDepth_m)) continue;
    const Eigen::Vector3d seen = odometry::project(calibration, moved);
    const auto disparity = sample_disparity(to.disparity, seen.x() + 4 * best_x, seen.y() + 4 * best_y);
    if (disparity) changes.push_back(disparity->value - seen.z());
    moved_points.push_back(seen);
  }
  if (moved_points.empty()) return camera;
  double change = changes.empty() ? 0 : median(std::move(changes));
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& seen : moved_points) middle += seen;
  middle /= static_cast<double>(moved_points.size());
  if (std::abs(change) > 0.3 * middle.z()) change = 0;
  const Eigen::Vector3d there(middle.x() + 4 * best_x, middle.y() + 4 * best_y, middle.z() + change);
  const Eigen::Vector3d shift = odometry::triangulate(calibration, there.x(), there.y(), there.z()) -
                                odometry::triangulate(calibration, middle.x(), middle.y(), middle.z());
  return Eigen::Translation3d(shift) * camera;
}

}  // namespace egosgm::vision
