// SPDX-License-Identifier: Apache-2.0
#include "vision/pose_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

#include "host/quantile.h"

namespace egosgm::vision {
namespace {

using Motion = Eigen::Isometry3d;

constexpr double kLeastMove_m = 0.01, kLeastTurn = 0.003;  // less is noise of the odometry
constexpr double kAgrees = 0.35;                           // of a motion, in the median
constexpr std::size_t kFewestMoves = 2;

double angle_of(const Motion& motion) { return Eigen::AngleAxisd(motion.rotation()).angle(); }

/// The distance of a given motion from the one that was found, in parts of it.
double difference(const Motion& given, const Motion& found) {
  const double moved =
      (given.translation() - found.translation()).norm() / std::max(found.translation().norm(), kLeastMove_m);
  const double turned = angle_of(given * found.inverse()) / std::max(angle_of(found), 5 * kLeastTurn);
  return std::max(moved, turned);
}

Motion scaled(Motion motion, double factor) {
  motion.translation() *= factor;
  return motion;
}

/// The motion in the camera's axes (x right, y down, z forward) of one that is told in others.
Motion turned(const Motion& motion, const Eigen::Matrix3d& camera_from_axes) {
  Motion turn = Motion::Identity();
  turn.linear() = camera_from_axes;
  return turn * motion * turn.inverse();
}

Eigen::Matrix3d rows(const Eigen::RowVector3d& x, const Eigen::RowVector3d& y, const Eigen::RowVector3d& z) {
  Eigen::Matrix3d matrix;
  matrix << x, y, z;
  return matrix;
}

}  // namespace

std::string suspect_motions(const std::vector<Motion>& given, const std::vector<std::optional<Motion>>& found) {
  std::vector<std::size_t> moves;  // where odometry tells something
  for (std::size_t i = 0; i < std::min(given.size(), found.size()); ++i) {
    if (found[i] && (found[i]->translation().norm() > kLeastMove_m || angle_of(*found[i]) > kLeastTurn)) {
      moves.push_back(i);
    }
  }
  if (moves.size() < kFewestMoves) return {};
  const auto score = [&](const auto& change, int later = 0) {
    std::vector<double> differences;
    for (const std::size_t i : moves) {
      const auto at = static_cast<std::ptrdiff_t>(i) + later;
      if (at < 0 || at >= static_cast<std::ptrdiff_t>(given.size())) continue;
      differences.push_back(difference(change(given[static_cast<std::size_t>(at)]), *found[i]));
    }
    return differences.size() < kFewestMoves ? 1e9 : median(differences);
  };
  const auto same = [](const Motion& motion) { return motion; };
  if (score(same) < kAgrees) return {};
  std::vector<double> ratios;
  for (const std::size_t i : moves) {
    const double is = given[i].translation().norm(), found_m = found[i]->translation().norm();
    if (found_m > kLeastMove_m) ratios.push_back(is / found_m);
  }
  const double ratio = ratios.empty() ? 1 : median(ratios);
  const std::array<std::pair<const char*, Eigen::Matrix3d>, 4> axes{
      {{"the camera's axes (x right, y down, z forward)", Eigen::Matrix3d::Identity()},
       {"a body's axes (x forward, y left, z up)", rows({0, -1, 0}, {0, 0, -1}, {1, 0, 0})},
       {"NED's axes (x forward, y right, z down)", rows({0, 1, 0}, {0, 0, 1}, {1, 0, 0})},
       {"OpenGL's axes (x right, y up, z backward)", rows({1, 0, 0}, {0, -1, 0}, {0, 0, -1})}}};
  char scale[200] = "";
  const bool is_scaled = ratio > 0 && (ratio > 2 || ratio < 0.5);
  if (is_scaled) {
    std::snprintf(scale, sizeof scale, "%.3g times as far as the odometry's (%s)", ratio,
                  ratio > 300  ? "millimetres in place of metres?"
                  : ratio > 30 ? "centimetres in place of metres?"
                               : "another unit?");
  }
  double best = kAgrees;
  std::string text;
  const auto consider = [&](double difference, const std::string& reason) {
    if (difference >= 0.7 * best && !(text.empty() && difference < best)) return;
    best = difference;
    text = reason;
  };
  for (const double factor : {1.0, is_scaled ? 1 / ratio : 1.0}) {
    const std::string unit = factor == 1.0 ? "" : std::string("they go ") + scale;
    for (const bool inverse : {false, true}) {
      for (std::size_t a = 0; a < axes.size(); ++a) {
        std::string reason = unit;
        const auto add = [&](const std::string& part) { reason += (reason.empty() ? "" : "; ") + part; };
        // Poses that are the inverses, world to camera, give P[k] P[k-1]^-1, which is the motion itself of the camera's
        // points, so that the motion that is taken is the inverse of P[k] P[k-1]^-1 turned by the pose.
        if (inverse) add("they are the inverses (world to camera): camera to world is meant");
        if (a > 0)
          add(std::string("they are told in ") + axes[a].first + ", the camera's are x right, y down, z forward");
        if (reason.empty()) continue;
        consider(score([&](const Motion& motion) {
                   const Motion turn = turned(scaled(motion, factor), axes[a].second);
                   return inverse ? turn.inverse() : turn;
                 }),
                 reason);
      }
    }
  }
  for (const int later : {-1, 1, -2, 2}) {
    const std::string frames = std::abs(later) == 1 ? "one frame" : "two frames";
    consider(score(same, later), "each is the pose of " + frames + (later < 0 ? " later" : " earlier"));
  }
  if (text.empty()) {
    text =
        is_scaled ? std::string("they go ") + scale : "they are of other frames, another camera or another convention";
  }
  return "the given poses contradict the images: " + text;
}

}  // namespace egosgm::vision
