// SPDX-License-Identifier: Apache-2.0
#include "egosgm/odometry.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <sstream>
#include <utility>

#include "egosgm/error.h"
#include "host/frame/check_frame.h"
#include "host/odometry/features.h"
#include "host/odometry/matching.h"
#include "host/odometry/motion.h"
#include "host/odometry/rectification.h"

namespace egosgm {

using namespace odometry;

namespace {

// From so many pixels on, features are sought at half the size, where noise is half as strong; their places are refined
// at the full size. Half of a smaller image has too few features.
constexpr int kPixelsToHalve = 200'000;
constexpr int kFeatureCell_px = 64;
constexpr int kRoughCell_px = 80, kRoughPerCell = 8;  // few strong features find the motion roughly
constexpr SearchWindow kPriorWindow{40, 24};
constexpr SearchWindow kGuidedWindow{5, 4};
constexpr double kRoughThreshold_px = 2.5;
// Standing still: no more than this, and no more than noise explains (99.9 % of six degrees of freedom).
constexpr double kStandstill_m = 0.01, kStandstill_rad = 1e-3, kStandstillChi2 = 22.5;

void require(bool condition, const char* what) {
  if (!condition) throw InvalidArgument(std::string("stereo odometry: ") + what);
}

void check_images(const ImageView& left, const ImageView& right) {
  require(left.data && right.data && left.width > 0 && left.height > 0, "image is empty; give both images of a frame");
  if (left.width != right.width || left.height != right.height || left.type != right.type) {
    std::ostringstream text;
    const auto bits = [](const ImageView& image) {
      return image.type == PixelType::kU8 ? " of 8 bits" : " of 16 bits";
    };
    text << "stereo odometry: left image is " << left.width << "x" << left.height << bits(left) << ", right image is "
         << right.width << "x" << right.height << bits(right) << "; give a rectified pair of one size and type";
    throw InvalidArgument(text.str());
  }
  check_rows("stereo odometry: left image: ", left);
  check_rows("stereo odometry: right image: ", right);
}

/// Milliseconds from lap to lap.
class Stopwatch {
 public:
  double lap() {
    const auto before = std::exchange(last_, Clock::now());
    return std::chrono::duration<double, std::milli>(last_ - before).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point last_ = Clock::now();
};

// That the motion is zero, but for noise.
bool is_standstill(const Motion& motion) {
  const Eigen::AngleAxisd rotation(motion.current_from_previous.linear());
  Vector6 xi;
  xi << motion.current_from_previous.translation(), rotation.angle() * rotation.axis();
  if (xi.head<3>().norm() > kStandstill_m || xi.tail<3>().norm() > kStandstill_rad) return false;
  return xi.dot(motion.covariance.ldlt().solve(xi)) <= kStandstillChi2;
}

}  // namespace

void StereoOdometryOptions::validate() const {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0; };
  require(positive(max_translation_m), "max_translation_m must be positive and finite");
  require(positive(max_rotation_deg) && max_rotation_deg <= 180, "max_rotation_deg must be in (0, 180]");
  require(corner_threshold > 0 && corner_threshold <= 4000, "corner_threshold must be in 1..4000");
  require(max_features > 0, "max_features must be positive");
  require(std::isfinite(max_disparity_px) && max_disparity_px >= 0 && max_disparity_px <= 1e4,
          "max_disparity_px must be in 0..10000");
  require(positive(max_flow_x_px) && max_flow_x_px <= 1e4, "max_flow_x_px must be in (0, 10000]");
  require(positive(max_flow_y_px) && max_flow_y_px <= 1e4, "max_flow_y_px must be in (0, 10000]");
  require(ransac_iterations > 0, "ransac_iterations must be positive");
  require(positive(inlier_threshold_px), "inlier_threshold_px must be positive");
  require(min_inliers >= 6, "min_inliers must be at least 6");
  require(std::isfinite(min_inlier_ratio) && min_inlier_ratio >= 0 && min_inlier_ratio <= 1,
          "min_inlier_ratio must be in 0..1");
}

struct StereoOdometry::State {
  Calibration calibration;
  StereoOdometryOptions options;
  FeatureDetector detector;
  GreyImage half;
  TrackedFrame previous, current;
  bool has_previous = false;
  RectificationError rectification;
  std::optional<Eigen::Isometry3d> last_motion;

  int max_disparity_px(int width) const {
    return options.max_disparity_px > 0 ? static_cast<int>(std::ceil(options.max_disparity_px)) : width / 5;
  }

  void read_frame(const ImageView& left, const ImageView& right);
  MotionEstimate rough_motion(const std::optional<Eigen::Isometry3d>& prior);
  void estimate(const std::optional<Eigen::Isometry3d>& prior, OdometryResult& result);
  void keep_tracks(const std::vector<CircularMatch>& matches, const std::vector<int>& inliers);
};

void StereoOdometry::State::read_frame(const ImageView& left, const ImageView& right) {
  const GreyLevels levels = levels_of(left, right);
  to_grey(left, levels, current.left);
  to_grey(right, levels, current.right);
  const bool halves = current.left.pixels.size() >= kPixelsToHalve;
  const double cell_px = (halves ? 2 : 1) * kFeatureCell_px;
  const double cells = std::ceil(left.width / cell_px) * std::ceil(left.height / cell_px);
  const int per_cell = static_cast<int>(std::ceil(options.max_features / cells));
  const auto detect = [&](const GreyImage& image, FeatureSet& set) {
    if (halves) halve(image, half);
    detector.detect(halves ? half : image, options.corner_threshold, per_cell, set);
    if (halves) enlarge(set, image.height);
  };
  detect(current.left, current.left_features);
  detect(current.right, current.right_features);
  current.reset_matches();
}

// From few features: near the prior, and where that fails, anywhere.
MotionEstimate StereoOdometry::State::rough_motion(const std::optional<Eigen::Isometry3d>& prior) {
  const std::vector<int> queries = select_spread(previous, kRoughCell_px, kRoughPerCell);
  const int disparity = max_disparity_px(current.left.width);
  // Wide windows let in more false matches; whether the motion holds is seen on the refined ones.
  StereoOdometryOptions lenient = options;
  lenient.min_inlier_ratio *= 0.25;
  lenient.min_inliers = std::max(6, options.min_inliers / 2);
  const auto attempt = [&](const Eigen::Isometry3d* motion, const SearchWindow& window) {
    const auto matches = match_circle(calibration, previous, current, queries, motion, window, disparity);
    return estimate_motion(calibration, lenient, pixel_matches(previous, current, matches),
                           motion ? *motion : Eigen::Isometry3d::Identity(), kRoughThreshold_px);
  };
  MotionEstimate near;
  if (prior && out_of_bounds(options, *prior).empty()) {
    near = attempt(&*prior, kPriorWindow);
    if (near.reason.empty() && static_cast<int>(near.inliers.size()) >= options.min_inliers) return near;
  }
  MotionEstimate anywhere = attempt(nullptr, {options.max_flow_x_px, options.max_flow_y_px});
  const bool is_near_better = near.reason.empty() && near.inliers.size() > anywhere.inliers.size();
  return is_near_better ? near : anywhere;
}

void StereoOdometry::State::estimate(const std::optional<Eigen::Isometry3d>& prior, OdometryResult& result) {
  if (result.features < options.min_inliers) {
    result.reason =
        "too few features: " + std::to_string(result.features) + " of at least " + std::to_string(options.min_inliers);
    return;
  }
  Stopwatch stopwatch;
  const MotionEstimate rough = rough_motion(prior ? prior : last_motion);
  result.times_ms.rough_motion = stopwatch.lap();
  result.reason = rough.reason;
  if (!rough.reason.empty()) return;

  std::vector<CircularMatch> refined;
  std::vector<int> all(previous.left_features.size());
  std::iota(all.begin(), all.end(), 0);
  const Eigen::Isometry3d motion = rough.motion.current_from_previous;
  const auto candidates =
      match_circle(calibration, previous, current, all, &motion, kGuidedWindow, max_disparity_px(current.left.width));
  auto points = refine_matches(calibration, previous, current, candidates, motion, refined);
  if (options.learn_rectification) rectification.correct(calibration, points);
  result.times_ms.matching = stopwatch.lap();
  const MotionEstimate fine = refine_motion(calibration, options, MatchNoise{}, points, motion);
  result.times_ms.motion = stopwatch.lap();
  result.matches = static_cast<int>(points.size());
  result.inliers = static_cast<int>(fine.inliers.size());
  result.reprojection_rms_px = fine.rms_px;
  result.reason = fine.reason;
  keep_tracks(refined, fine.inliers);
  if (!result.reason.empty()) return;
  result.motion = fine.motion;
  result.standstill = is_standstill(fine.motion);
  if (result.standstill) {
    result.motion->current_from_previous.setIdentity();
    return;
  }
  stopwatch.lap();
  if (options.learn_rectification) {
    rectification.update(calibration, MatchNoise{}, points, fine.inliers, fine.motion.current_from_previous);
  }
  result.times_ms.learning = stopwatch.lap();
}

// Matches that agree with the motion go on as tracks; all others start anew at their pixels.
void StereoOdometry::State::keep_tracks(const std::vector<CircularMatch>& matches, const std::vector<int>& inliers) {
  std::vector<bool> tracked(current.left_features.size(), false);
  for (const int k : inliers) {
    tracked[matches[k].current_left] = true;
    current.age[matches[k].current_left] = previous.age[matches[k].previous_left] + 1;
  }
  for (int i = 0; i < current.left_features.size(); ++i) {
    if (tracked[i]) continue;
    current.u[i] = current.left_features.features[i].x;
    current.v[i] = current.left_features.features[i].y;
    current.disparity[i] = kUntried;
  }
}

StereoOdometry::StereoOdometry(const Calibration& calibration, const StereoOdometryOptions& options)
    : state_(std::make_unique<State>()) {
  calibration.validate();
  options.validate();
  state_->calibration = calibration;
  state_->options = options;
}

StereoOdometry::~StereoOdometry() = default;
StereoOdometry::StereoOdometry(StereoOdometry&&) noexcept = default;
StereoOdometry& StereoOdometry::operator=(StereoOdometry&&) noexcept = default;

OdometryResult StereoOdometry::process(const ImageView& left, const ImageView& right,
                                       const std::optional<Isometry>& prior) {
  check_images(left, right);
  if (prior) Motion{*prior}.validate();
  State& state = *state_;
  if (state.has_previous && (left.width != state.previous.left.width || left.height != state.previous.left.height)) {
    std::ostringstream text;
    text << "stereo odometry: image size changed from " << state.previous.left.width << "x"
         << state.previous.left.height << " to " << left.width << "x" << left.height << "; call reset() first";
    throw InvalidArgument(text.str());
  }
  OdometryResult result;
  Stopwatch stopwatch;
  state.read_frame(left, right);
  result.times_ms.features = stopwatch.lap();
  result.features = state.current.left_features.size();
  if (state.has_previous) {
    state.estimate(prior, result);
  } else {
    result.reason = "first frame";
  }
  state.last_motion.reset();
  if (result.motion) state.last_motion = result.motion->current_from_previous;
  // The frame where the camera stopped stays the reference: noise does not add up, and creeping is seen as soon as it
  // is more than noise.
  if (!result.standstill) std::swap(state.previous, state.current);
  state.has_previous = true;
  return result;
}

void StereoOdometry::reset() {
  state_->has_previous = false;
  state_->last_motion.reset();
  state_->rectification = {};
}

}  // namespace egosgm
