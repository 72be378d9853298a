// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/pose_evaluation.h"

#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "egosgm/error.h"

namespace egosgm::vision {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kDegPerRad = 180.0 / 3.14159265358979323846;

using Poses = std::vector<Eigen::Isometry3d>;

double angle_of(const Eigen::Isometry3d& error) { return Eigen::AngleAxisd(error.linear()).angle(); }

/// What is left of the true motion between two frames after undoing the estimated one.
Eigen::Isometry3d motion_error(const Poses& estimate, const Poses& truth, std::size_t from, std::size_t to) {
  const Eigen::Isometry3d estimated = estimate[from].inverse() * estimate[to];
  const Eigen::Isometry3d true_one = truth[from].inverse() * truth[to];
  return estimated.inverse() * true_one;
}

std::vector<double> travelled_m(const Poses& poses) {
  std::vector<double> distance(poses.size(), 0.0);
  for (std::size_t k = 1; k < poses.size(); ++k) {
    distance[k] = distance[k - 1] + (poses[k].translation() - poses[k - 1].translation()).norm();
  }
  return distance;
}

void add_motions(const Poses& estimate, const Poses& truth, PoseEvaluation& result) {
  double translation = 0, rotation = 0;
  for (std::size_t k = 1; k < truth.size(); ++k) {
    const Eigen::Isometry3d error = motion_error(estimate, truth, k - 1, k);
    result.motions.push_back({error.translation().norm(), angle_of(error)});
    translation += error.translation().squaredNorm();
    rotation += result.motions.back().rotation_rad * result.motions.back().rotation_rad;
  }
  for (const RelativePoseError& motion : result.motions) {
    result.translation_mean_m += motion.translation_m / result.motions.size();
    result.rotation_mean_rad += motion.rotation_rad / result.motions.size();
  }
  const auto count = static_cast<double>(result.motions.size());
  result.translation_rmse_m = std::sqrt(translation / count);
  result.rotation_rmse_rad = std::sqrt(rotation / count);
}

void add_drift(const Poses& estimate, const Poses& truth, PoseEvaluation& result) {
  const Eigen::Isometry3d estimated = estimate.front().inverse() * estimate.back();
  const Eigen::Isometry3d true_one = truth.front().inverse() * truth.back();
  result.end_drift_m = (estimated.translation() - true_one.translation()).norm();
  result.end_drift_percent = result.path_length_m > 0 ? 100.0 * result.end_drift_m / result.path_length_m : kNaN;
  result.rotation_end_drift_deg = kDegPerRad * angle_of(estimated.inverse() * true_one);
}

/// The first frame more than `length_m` after `from`, or the number of frames.
std::size_t end_of_segment(const std::vector<double>& distance_m, std::size_t from, double length_m) {
  std::size_t to = from;
  while (to < distance_m.size() && distance_m[to] <= distance_m[from] + length_m) ++to;
  return to;
}

void add_segments(const Poses& estimate, const Poses& truth, const std::vector<double>& distance_m,
                  PoseEvaluation& result) {
  constexpr int kLengths = 8, kShortLengths = 10;
  constexpr double kStep_m = 100.0, kShortStep_m = 5.0;
  result.short_segments = result.path_length_m < kStep_m;
  const std::size_t frame_step = result.short_segments ? 1 : 10;
  int segments = 0;
  double translation = 0, rotation = 0;
  for (int i = 1; i <= (result.short_segments ? kShortLengths : kLengths); ++i) {
    SegmentError mean{.length_m = i * (result.short_segments ? kShortStep_m : kStep_m)};
    for (std::size_t from = 0; from < truth.size(); from += frame_step) {
      const std::size_t to = end_of_segment(distance_m, from, mean.length_m);
      if (to == truth.size()) break;
      const Eigen::Isometry3d error = motion_error(estimate, truth, from, to);
      mean.translation_percent += 100.0 * error.translation().norm() / mean.length_m;
      mean.rotation_deg_per_m += kDegPerRad * angle_of(error) / mean.length_m;
      ++mean.segments;
    }
    if (mean.segments == 0) continue;
    segments += mean.segments;
    translation += mean.translation_percent;
    rotation += mean.rotation_deg_per_m;
    mean.translation_percent /= mean.segments;
    mean.rotation_deg_per_m /= mean.segments;
    result.segments.push_back(mean);
  }
  result.segment_translation_percent = segments > 0 ? translation / segments : kNaN;
  result.segment_rotation_deg_per_m = segments > 0 ? rotation / segments : kNaN;
}

}  // namespace

PoseEvaluation evaluate_poses(const Poses& estimate, const Poses& truth) {
  if (estimate.size() != truth.size() || truth.size() < 2) {
    throw InvalidArgument("poses: " + std::to_string(estimate.size()) + " estimated and " +
                          std::to_string(truth.size()) + " true ones; give as many of both, at least two");
  }
  PoseEvaluation result;
  const std::vector<double> distance_m = travelled_m(truth);
  result.path_length_m = distance_m.back();
  add_motions(estimate, truth, result);
  add_drift(estimate, truth, result);
  add_segments(estimate, truth, distance_m, result);
  return result;
}

}  // namespace egosgm::vision
