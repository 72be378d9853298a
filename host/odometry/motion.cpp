// SPDX-License-Identifier: Apache-2.0
#include "host/odometry/motion.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

#include "host/quantile.h"

namespace egosgm::odometry {
namespace {

// Narrow: patches across a depth edge follow neither surface, and pull all one way.
constexpr double kCauchy2 = 2;
// Matches on one surface share errors of their patches' shape: on rendered scenes, whose motion is known, squared
// errors are this many times what independent residuals would give (1.2 to 4.5 times, by scene and size).
constexpr double kCorrelated = 2.3;
constexpr std::size_t kFullPart = 3;  // matches from which on a part of the image counts in full
constexpr double kPart_px = 80;       // side of a part of the image in RANSAC
// Disparities of static points change as the motion says. Errors of the calibration and of matching move their median,
// by more where images are larger. What moves with the camera changes by all that the motion does not explain.
constexpr double kUnexplainedGrowth_px = 0.3;
constexpr double kUnexplainedPart = 0.5;

// SplitMix64 (Steele et al., OOPSLA 2014): the same numbers on every platform.
class Generator {
 public:
  explicit Generator(std::uint64_t seed) : state_(seed) {}
  int below(int n) {
    state_ += 0x9e3779b97f4a7c15ull;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    z ^= z >> 31;
    return static_cast<int>(((z >> 32) * static_cast<std::uint64_t>(n)) >> 32);
  }

 private:
  std::uint64_t state_;
};

struct Scene {
  std::vector<Eigen::Vector3d> points;    // previous left camera's frame
  std::vector<Eigen::Vector3d> measured;  // (u2, v2, d2)
};

Scene make_scene(const Calibration& calibration, const std::vector<PointMatch>& matches) {
  Scene scene;
  scene.points.reserve(matches.size());
  scene.measured.reserve(matches.size());
  for (const PointMatch& m : matches) {
    scene.points.push_back(triangulate(calibration, m.u1, m.v1, m.d1));
    scene.measured.emplace_back(m.u2, m.v2, m.d2);
  }
  return scene;
}

// Squared reprojection error, mean of the left and the right image's; large behind the camera.
double squared_error(const Eigen::Vector3d& residual) {
  const double right = residual.x() - residual.z();
  return 0.5 * (residual.x() * residual.x() + right * right) + residual.y() * residual.y();
}

// Gauss-Newton on three matches.
bool solve_sample(const Calibration& calibration, const Scene& scene, const int sample[3], Eigen::Isometry3d& motion) {
  for (int k = 0; k < 8; ++k) {
    Matrix6 normal = Matrix6::Zero();
    Vector6 right = Vector6::Zero();
    for (int s = 0; s < 3; ++s) {
      const Eigen::Vector3d p = motion * scene.points[sample[s]];
      if (p.z() < kMinDepth_m) return false;  // to save time: the score counts no point behind the camera
      const Eigen::Vector3d residual = scene.measured[sample[s]] - project(calibration, p);
      const MotionJacobian j = motion_jacobian(projection_jacobian(calibration, p), p);
      normal.noalias() += j.transpose() * j;
      right.noalias() += j.transpose() * residual;
    }
    const Eigen::LDLT<Matrix6> solver(normal);
    const Vector6 diagonal = solver.vectorD();
    if (!(diagonal.minCoeff() > 1e-9 * diagonal.maxCoeff())) return false;
    const Vector6 step = solver.solve(right);
    if (!step.allFinite() || step.norm() > 50) return false;
    motion = perturb(step, motion);
    if (step.squaredNorm() < 1e-8) return true;
  }
  return true;
}

struct Parts {
  std::vector<std::vector<int>> members;
  std::vector<double> weights;  // of each match
  double total = 0;
};

Parts divide(const std::vector<PointMatch>& matches) {
  std::map<std::pair<int, int>, std::vector<int>> by_place;
  for (int i = 0; i < static_cast<int>(matches.size()); ++i) {
    by_place[{static_cast<int>(matches[i].v2 / kPart_px), static_cast<int>(matches[i].u2 / kPart_px)}].push_back(i);
  }
  Parts parts;
  parts.weights.resize(matches.size());
  for (auto& [place, members] : by_place) {
    const double weight = 1.0 / std::max<std::size_t>(members.size(), kFullPart);
    for (const int i : members) parts.weights[i] = weight;
    parts.total += weight * members.size();
    parts.members.push_back(std::move(members));
  }
  return parts;
}

struct Score {
  double value = 0;
  double share = 0;  // of the weights, that agree
};

Score score_motion(const Calibration& calibration, const Scene& scene, const Parts& parts,
                   const Eigen::Isometry3d& motion, double threshold_px) {
  Score score;
  const double limit = threshold_px * threshold_px;
  const Eigen::Matrix3d rotation = motion.linear();
  const Eigen::Vector3d translation = motion.translation();
  for (std::size_t i = 0; i < scene.points.size(); ++i) {
    const Eigen::Vector3d p = rotation * scene.points[i] + translation;
    if (p.z() < kMinDepth_m) continue;
    const double error = squared_error(scene.measured[i] - project(calibration, p));
    if (error >= limit) continue;
    score.value += parts.weights[i] * (1 - error / limit);
    score.share += parts.weights[i];
  }
  score.share /= parts.total;
  return score;
}

std::string format(const char* text, double a, double b) {
  char buffer[192];
  std::snprintf(buffer, sizeof(buffer), text, a, b);
  return buffer;
}

double rotation_deg(const Eigen::Matrix3d& rotation) {
  return Eigen::AngleAxisd(rotation).angle() * 180 / 3.14159265358979323846;
}

void collect_inliers(const Calibration& calibration, const Scene& scene, double threshold_px,
                     MotionEstimate& estimate) {
  estimate.inliers.clear();
  double sum = 0;
  for (int i = 0; i < static_cast<int>(scene.points.size()); ++i) {
    const Eigen::Vector3d p = estimate.motion.current_from_previous * scene.points[i];
    if (p.z() < kMinDepth_m) continue;
    const double error = squared_error(scene.measured[i] - project(calibration, p));
    if (error >= threshold_px * threshold_px) continue;
    estimate.inliers.push_back(i);
    sum += error;
  }
  estimate.rms_px = estimate.inliers.empty() ? 0 : std::sqrt(sum / estimate.inliers.size());
}

std::string too_few(const StereoOdometryOptions& options, std::size_t inliers, std::size_t matches) {
  if (static_cast<int>(inliers) < options.min_inliers) {
    return format("too few inliers: %.0f of at least %.0f", static_cast<double>(inliers), options.min_inliers);
  }
  if (inliers < options.min_inlier_ratio * matches) {
    return format("inlier ratio %.2f is below %.2f", static_cast<double>(inliers) / matches, options.min_inlier_ratio);
  }
  return {};
}

// By how much the inliers' disparities grew, and by how much beyond what the motion explains: medians [px].
struct DisparityGrowth {
  double all_px, unexplained_px;
};

DisparityGrowth disparity_growth(const Calibration& calibration, const Scene& scene, const MotionEstimate& estimate) {
  std::vector<double> all, unexplained;
  for (const int i : estimate.inliers) {
    const double now = scene.measured[i].z();
    all.push_back(now - project(calibration, scene.points[i]).z());
    unexplained.push_back(now - project(calibration, estimate.motion.current_from_previous * scene.points[i]).z());
  }
  return {median(std::move(all)), median(std::move(unexplained))};
}

struct NormalEquations {
  Matrix6 normal = Matrix6::Zero();
  Vector6 right = Vector6::Zero();
  double cost = 0;    // sum of weighted squared errors
  double weight = 0;  // sum of the weights
};

NormalEquations accumulate(const Calibration& calibration, const MatchNoise& noise,
                           const std::vector<PointMatch>& matches, const std::vector<int>& inliers,
                           const Eigen::Isometry3d& motion) {
  NormalEquations sums;
  for (const int i : inliers) {
    const Residual residual = linearise(calibration, noise, matches[i], motion);
    const double squared = residual.value.dot(residual.information * residual.value);
    const double weight = cauchy_weight(squared, kCauchy2);
    const Eigen::Matrix<double, 6, 3> weighted = weight * residual.by_motion.transpose() * residual.information;
    sums.normal.noalias() += weighted * residual.by_motion;
    sums.right.noalias() += weighted * residual.value;
    sums.cost += weight * squared;
    sums.weight += weight;
  }
  return sums;
}

}  // namespace

Eigen::Isometry3d perturb(const Vector6& xi, const Eigen::Isometry3d& motion) {
  const Eigen::Vector3d w = xi.tail<3>();
  const double angle = w.norm();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity(), v = Eigen::Matrix3d::Identity();
  if (angle > 1e-12) {
    const Eigen::Vector3d axis = w / angle;
    rotation = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    Eigen::Matrix3d k;
    k << 0, -axis.z(), axis.y(), axis.z(), 0, -axis.x(), -axis.y(), axis.x(), 0;
    v += (1 - std::cos(angle)) / angle * k + (1 - std::sin(angle) / angle) * k * k;
  }
  Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
  step.linear() = rotation;
  step.translation() = v * xi.head<3>();
  Eigen::Isometry3d moved = step * motion;
  moved.linear() = Eigen::Quaterniond(moved.linear()).normalized().toRotationMatrix();
  return moved;
}

std::string out_of_bounds(const StereoOdometryOptions& options, const Eigen::Isometry3d& motion) {
  const double length = motion.translation().norm();
  if (!(length <= options.max_translation_m)) {
    return format("translation of %.2f m exceeds the bound of %.2f m", length, options.max_translation_m);
  }
  const double angle = rotation_deg(motion.linear());
  if (!(angle <= options.max_rotation_deg)) {
    return format("rotation of %.2f deg exceeds the bound of %.2f deg", angle, options.max_rotation_deg);
  }
  return {};
}

MotionEstimate estimate_motion(const Calibration& calibration, const StereoOdometryOptions& options,
                               const std::vector<PointMatch>& matches, const Eigen::Isometry3d& guess,
                               double threshold_px) {
  MotionEstimate estimate;
  const Parts parts = divide(matches);
  if (static_cast<int>(matches.size()) < options.min_inliers || parts.members.size() < 3) {
    estimate.reason = format("too few matches: %.0f in %.0f parts of the image", static_cast<double>(matches.size()),
                             static_cast<double>(parts.members.size()));
    return estimate;
  }
  const Scene scene = make_scene(calibration, matches);
  Generator generator(options.seed);
  Score best = score_motion(calibration, scene, parts, guess, threshold_px);
  estimate.motion.current_from_previous = guess;
  int needed = options.ransac_iterations;
  for (int k = 0; k < needed; ++k) {
    int part[3], sample[3];
    const int count = static_cast<int>(parts.members.size());
    part[0] = generator.below(count);
    part[1] = (part[0] + 1 + generator.below(count - 1)) % count;
    do part[2] = generator.below(count);
    while (part[2] == part[0] || part[2] == part[1]);
    for (int s = 0; s < 3; ++s) {
      const auto& members = parts.members[part[s]];
      sample[s] = members[generator.below(static_cast<int>(members.size()))];
    }
    Eigen::Isometry3d motion = guess;
    if (!solve_sample(calibration, scene, sample, motion)) continue;
    const Score score = score_motion(calibration, scene, parts, motion, threshold_px);
    if (score.value <= best.value) continue;
    best = score;
    estimate.motion.current_from_previous = motion;
    // Enough samples that one without outliers is among them, but for one time in 10^5; half of the good samples are
    // taken to be spoiled by noise.
    const double good = 0.5 * std::pow(score.share, 3);
    needed = std::min<int>(options.ransac_iterations, std::max(20.0, std::log(1e-5) / std::log1p(-good)));
  }
  collect_inliers(calibration, scene, threshold_px, estimate);
  estimate.reason = too_few(options, estimate.inliers.size(), matches.size());
  return estimate;
}

MotionEstimate refine_motion(const Calibration& calibration, const StereoOdometryOptions& options,
                             const MatchNoise& noise, const std::vector<PointMatch>& matches,
                             const Eigen::Isometry3d& start) {
  MotionEstimate estimate;
  estimate.motion.current_from_previous = start;
  const Scene scene = make_scene(calibration, matches);
  NormalEquations sums;
  for (int k = 0; k < 15; ++k) {
    if (k < 4) collect_inliers(calibration, scene, options.inlier_threshold_px, estimate);
    if (estimate.inliers.size() < 6) break;
    sums = accumulate(calibration, noise, matches, estimate.inliers, estimate.motion.current_from_previous);
    const Vector6 step = sums.normal.ldlt().solve(sums.right);
    if (!step.allFinite()) break;
    estimate.motion.current_from_previous = perturb(step, estimate.motion.current_from_previous);
    if (k >= 4 && step.norm() < 1e-7) break;
  }
  collect_inliers(calibration, scene, options.inlier_threshold_px, estimate);
  estimate.reason = too_few(options, estimate.inliers.size(), matches.size());
  if (!estimate.reason.empty()) return estimate;
  const DisparityGrowth growth = disparity_growth(calibration, scene, estimate);
  const double most_px = std::max(kUnexplainedGrowth_px, kUnexplainedPart * std::abs(growth.all_px));
  if (std::abs(growth.unexplained_px) > most_px) {
    estimate.reason = format(
        "disparities changed by %+.2f px more than the motion explains (at most %.2f px): the features "
        "move with the camera, as a projector's dots do, or doffs_px is wrong",
        growth.unexplained_px, most_px);
    return estimate;
  }
  sums = accumulate(calibration, noise, matches, estimate.inliers, estimate.motion.current_from_previous);
  const double variance = sums.cost / std::max(1.0, 3 * sums.weight - 6);
  const Matrix6 covariance = kCorrelated * variance * sums.normal.inverse();
  const double sigma_m = std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  const double sigma_deg = std::sqrt(covariance.bottomRightCorner<3, 3>().trace()) * 180 / 3.14159265358979323846;
  if (!(sigma_m < 0.5 && sigma_deg < 2)) {
    estimate.reason = format("degenerate geometry: standard deviation %.2f m, %.2f deg", sigma_m, sigma_deg);
    return estimate;
  }
  estimate.motion.covariance = 0.5 * (covariance + covariance.transpose());
  estimate.reason = out_of_bounds(options, estimate.motion.current_from_previous);
  return estimate;
}

}  // namespace egosgm::odometry
