// SPDX-License-Identifier: Apache-2.0
#include "host/forward_warp.h"

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context) {
  context.enter("ForwardWarp");
  return context.program("forward_warp.cl", {});
}

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
  set_row(result.x, h, 0);
  set_row(result.y, h, 1);
  set_row(result.w, h, 3);
  result.cx = static_cast<float>(calibration.cx + (is_right ? calibration.doffs_px : 0));
  result.cy = static_cast<float>(calibration.cy);
  result.doffs = static_cast<float>(calibration.doffs_px);
  set_noise(result, calibration, current_from_previous.covariance, is_right ? calibration.baseline_m : 0);
  return result;
}

ForwardWarp::ForwardWarp(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
                         const ForwardWarpOptions& options, shared::DisparityRange range)
    : context_(context),
      size_(size),
      calibration_(calibration),
      process_noise_px2_(options.process_noise_px2),
      range_(range),
      move_(build(context), "move"),
      splat_disparity_(build(context), "splat_disparity"),
      splat_variance_(build(context), "splat_variance"),
      decode_(build(context), "decode"),
      landed_(context, 2 * pixel_count(size)),
      moved_key_(context, 2 * pixel_count(size)),
      moved_variance_(context, 2 * pixel_count(size)),
      zbuffer_(context, 2 * pixel_count(size)) {}

void ForwardWarp::operator()(const StereoMaps& belief, const Motion& current_from_previous, StereoMaps& predicted) {
  context_.enter("ForwardWarp");
  const ocl::Range pixels = ocl::every_pixel(context_, size_);
  for (const cl_int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
    const shared::DisparityMotion motion = disparity_motion(calibration_, current_from_previous, view);
    move_(context_, ocl::every_pixel(context_, size_, 1), size_, range_, view, motion, process_noise_px2_,
          belief.disparity, belief.variance, landed_, moved_key_, moved_variance_, zbuffer_, predicted.variance);
  }
  splat_disparity_(context_, pixels, size_, landed_, moved_key_, zbuffer_);
  splat_variance_(context_, pixels, size_, landed_, moved_key_, moved_variance_, zbuffer_, predicted.variance);
  decode_(context_, pixels, size_, zbuffer_, predicted.disparity);
}

}  // namespace egosgm
