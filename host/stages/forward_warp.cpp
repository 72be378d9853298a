// SPDX-License-Identifier: Apache-2.0
#include "host/stages/forward_warp.h"

namespace egosgm {
namespace {

// Gamma of eq. 1: (x - cx, y - cy, d + doffs, 1) ~ Gamma (X, Y, Z, 1).
Eigen::Matrix4d disparity_from_space(const Calibration& calibration) {
  Eigen::Matrix4d gamma = Eigen::Matrix4d::Zero();
  gamma(0, 0) = calibration.fx;
  gamma(1, 1) = calibration.fy;
  gamma(2, 3) = calibration.fx * calibration.baseline_m;
  gamma(3, 2) = 1;
  return gamma;
}

// The motion as the view's own camera sees it: B^-1 T B for the right one.
Eigen::Isometry3d motion_of_view(const Calibration& calibration, const Eigen::Isometry3d& current_from_previous,
                                 int view) {
  if (view == EGOSGM_LEFT) return current_from_previous;
  const Eigen::Translation3d left_from_right(calibration.baseline_m, 0, 0);
  return left_from_right.inverse() * current_from_previous * left_from_right;
}

void set_row(shared::f32 (&row)[4], const Eigen::Matrix4d& h, int index) {
  for (int column = 0; column < 4; ++column) row[column] = static_cast<float>(h(index, column));
}

// A left perturbation moves the depth by dZ' = dt_z + w_x Y' - w_y X', and the disparity by -(d'^2 / (fx b)) dZ', where
// X' d' = (x' - cx) b and Y' d' = (y' - cy) b fx / fy: so a disparity near zero divides nothing. X' is the left
// camera's; the right one's is smaller by b.
void set_noise(shared::DisparityMotion& motion, const Calibration& calibration,
               const Eigen::Matrix<double, 6, 6>& covariance, double shift_m) {
  constexpr int kTz = 2, kWx = 3, kWy = 4;
  const double x = -2 * covariance(kTz, kWy), y = 2 * covariance(kTz, kWx);
  const double xx = covariance(kWy, kWy), xy = -2 * covariance(kWx, kWy), yy = covariance(kWx, kWx);
  const double one = covariance(kTz, kTz) + x * shift_m + xx * shift_m * shift_m;
  const double by_d = 1 / (calibration.fx * calibration.baseline_m), by_u = 1 / calibration.fx,
               by_v = 1 / calibration.fy;
  motion.noise_dd = static_cast<float>(one * by_d * by_d);
  motion.noise_dx = static_cast<float>((x + 2 * xx * shift_m) * by_d * by_u);
  motion.noise_dy = static_cast<float>((y + xy * shift_m) * by_d * by_v);
  motion.noise_xx = static_cast<float>(xx * by_u * by_u);
  motion.noise_xy = static_cast<float>(xy * by_u * by_v);
  motion.noise_yy = static_cast<float>(yy * by_v * by_v);
}

}  // namespace

shared::DisparityMotion disparity_motion(const Calibration& calibration, const Motion& current_from_previous,
                                         int view) {
  const Eigen::Matrix4d gamma = disparity_from_space(calibration);
  const Eigen::Isometry3d motion = motion_of_view(calibration, current_from_previous.current_from_previous, view);
  const Eigen::Matrix4d h = gamma * motion.matrix() * gamma.inverse();
  const bool is_right = view == EGOSGM_RIGHT;

  shared::DisparityMotion result{};
  result.row_step = 1;
  set_row(result.x, h, 0);
  set_row(result.y, h, 1);
  set_row(result.w, h, 3);
  result.cx = static_cast<float>(calibration.cx + (is_right ? calibration.doffs_px : 0));
  result.cy = static_cast<float>(calibration.cy);
  result.doffs = static_cast<float>(calibration.doffs_px);
  set_noise(result, calibration, current_from_previous.covariance, is_right ? calibration.baseline_m : 0);
  return result;
}

ForwardWarp::Atomics::Atomics(ocl::Context& context, const ocl::Stage& stage)
    : move(stage, "move"),
      splat_disparity(stage, "splat_disparity"),
      splat_variance(stage, "splat_variance"),
      decode(stage, "decode_warped"),
      landed(context, ocl::Scratch::kOfStage0, 2 * pixel_count(stage.size())),
      moved_key(context, ocl::Scratch::kOfStage1, 2 * pixel_count(stage.size())),
      moved_variance(context, ocl::Scratch::kOfStage2, 2 * pixel_count(stage.size())),
      zbuffer(context, ocl::Scratch::kOfStage3, 2 * pixel_count(stage.size())),
      most_evidence(context, ocl::Scratch::kOfStage4, 2 * pixel_count(stage.size())) {}

ForwardWarp::Bands::Bands(ocl::Context& context, const ocl::Stage& stage)
    : find_spans(stage, "find_spans"),
      splat_bands(stage, "splat_bands"),
      spans(context, 4 * static_cast<std::size_t>(stage.size().height)) {}

ForwardWarp::ForwardWarp(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
                         const ForwardWarpOptions& options, shared::DisparityRange range, int pixels, int band_rows)
    : stage_(context, "ForwardWarp", "forward_warp.cl", size, pixels),
      calibration_(calibration),
      options_(options),
      range_(range),
      band_rows_(band_rows) {
  if (stage_.pixels() == 1) {
    atomics_.emplace(context, stage_);
  } else {
    bands_.emplace(context, stage_);
  }
}

void ForwardWarp::warp(const StereoMaps& belief, const FlagMap& evidence, const Motion& current_from_previous,
                       StereoMaps& predicted, FlagMap& predicted_evidence, Views views) {
  ocl::Context& context = stage_.enter();
  const shared::ImageSize size = stage_.size();
  Motion motion = current_from_previous;
  motion.covariance *= static_cast<double>(options_.motion_noise);
  shared::DisparityMotion left = disparity_motion(calibration_, motion, EGOSGM_LEFT);
  shared::DisparityMotion right = disparity_motion(calibration_, motion, EGOSGM_RIGHT);
  left.row_step = right.row_step = views.row_step;
  if (bands_) {
    auto& [find_spans, splat_bands, spans] = *bands_;
    const int bands = (size.height + band_rows_ - 1) / band_rows_;
    find_spans(context, ocl::every_row(context, size, views.count), size, left, right, belief.disparity, spans);
    splat_bands(context, ocl::every_row(context, {1, views.count}, bands), size, range_, left, right,
                options_.process_noise_px2, band_rows_, spans, belief.disparity, belief.variance, evidence,
                predicted.disparity, predicted.variance, predicted_evidence);
    return;
  }
  auto& [move, splat_disparity, splat_variance, decode, landed, moved_key, moved_variance, zbuffer, most_evidence] =
      *atomics_;
  stage_.launch_pixels(move, views.count, range_, left, right, options_.process_noise_px2, belief.disparity,
                       belief.variance, landed, moved_key, moved_variance, zbuffer, predicted.variance, most_evidence);
  stage_.launch_pixels(splat_disparity, views.count, landed, moved_key, zbuffer);
  stage_.launch_pixels(splat_variance, views.count, landed, moved_key, moved_variance, zbuffer, predicted.variance,
                       evidence, most_evidence);
  stage_.launch_pixels(decode, views.count, range_, zbuffer, predicted.disparity, predicted.variance, most_evidence,
                       predicted_evidence);
}

}  // namespace egosgm
