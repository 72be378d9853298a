// SPDX-License-Identifier: Apache-2.0
// Forward warp of both views' disparity maps by the camera's motion (eqs. 1-6), nearest surface first.
//
// Several sources may land on one target. Disparities bid by atomic maxima of keys that are ordered as they are, then
// variances do among the sources that reached the winner, so the result does not depend on the order in which
// work-items run.
#include "shared.h"

// Where a source lands in its view, y < 0: nowhere. u, v: the same unrounded and relative to the principal point.
typedef struct {
  int x, y;
  float u, v;
  float disparity, metric_disparity, phi;
} Landing;

Landing land(const ImageSize size, const DisparityRange range, const DisparityMotion motion, const int x, const int y,
             const float disparity) {
  const float wx = (float)x - motion.cx;
  const float wy = (float)y - motion.cy;
  const float wd = disparity + motion.doffs;
  const float w = motion.w[0] * wx + motion.w[1] * wy + motion.w[2] * wd + motion.w[3];

  Landing landing;
  landing.phi = 1.0f / w;
  landing.u = (motion.x[0] * wx + motion.x[1] * wy + motion.x[2] * wd + motion.x[3]) * landing.phi;
  landing.v = (motion.y[0] * wx + motion.y[1] * wy + motion.y[2] * wd + motion.y[3]) * landing.phi;
  landing.metric_disparity = wd * landing.phi;
  landing.disparity = landing.metric_disparity - motion.doffs + 0.0f;  // + 0: there is one zero only

  // Asked of the floats, with comparisons that NaN fails, before any of them becomes an integer.
  const float target_x = landing.u + motion.cx;
  const float target_y = landing.v + motion.cy;
  const bool lands = disparity > EGOSGM_INVALID_DISPARITY && w > EGOSGM_MIN_DEPTH_RATIO && target_x > -1.0f &&
                     target_x < (float)size.width && target_y > -1.0f && target_y < (float)size.height &&
                     landing.disparity >= (float)range.min && landing.disparity <= (float)(range.min + range.count - 1);
  landing.x = convert_int_rte(lands ? target_x : -1.0f);
  landing.y = convert_int_rte(lands ? target_y : -1.0f);
  if (landing.x < 0 || landing.x >= size.width || landing.y >= size.height) landing.y = -1;
  return landing;
}

// Variance of the predicted disparity by the motion's covariance: (d'^2 / (fx b))^2 Var(Z'), Z' = (1, X', Y') form,
// with X' and Y' multiplied out so that nothing is divided by a disparity near zero.
float motion_variance(const DisparityMotion motion, const Landing landing) {
  const float d = landing.metric_disparity;
  const float a = d * d / motion.fx_baseline;
  const float bx = d * landing.u / motion.fx;
  const float by = d * landing.v / motion.fy;
  const float q = a * a * motion.noise_1 + a * bx * motion.noise_x + a * by * motion.noise_y +
                  bx * bx * motion.noise_xx + bx * by * motion.noise_xy + by * by * motion.noise_yy;
  return q < 0.0f ? 0.0f : q;  // rounding
}

float predicted_variance(const DisparityMotion motion, const Landing landing, const float variance,
                         const float process_noise) {
  const float p = landing.phi * landing.phi * variance + process_noise + motion_variance(motion, landing);
  return p < EGOSGM_MAX_VARIANCE_PX2 ? p : EGOSGM_MAX_VARIANCE_PX2;
}

// Unsigned integers that are ordered as the floats are; 0 is none of them.
uint key_of(const float disparity) {
  const uint bits = as_uint(disparity);
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}

float disparity_of(const uint key) { return as_float(key >> 31 ? key & 0x7fffffffu : ~key); }

size_t index_of(const ImageSize size, const int view, const int x, const int y) {
  return ((size_t)view * size.height + y) * size.width + x;
}

kernel void splat_disparity(const ImageSize size, const DisparityRange range, const DisparityMotion left,
                            const DisparityMotion right, global const float* disparity, global uint* zbuffer) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);

  Landing landing;
  landing.y = -1;
  uint key = 0;
  if (x < size.width) {
    landing = land(size, range, view == EGOSGM_LEFT ? left : right, x, y, disparity[index_of(size, view, x, y)]);
    key = key_of(landing.disparity);
  }
  // For CPUs: what comes before is vectorised over the work-group, atomics cannot be.
  barrier(CLK_LOCAL_MEM_FENCE);
  if (landing.y >= 0) atomic_max(&zbuffer[index_of(size, view, landing.x, landing.y)], key);
}

kernel void splat_variance(const ImageSize size, const DisparityRange range, const DisparityMotion left,
                           const DisparityMotion right, const float process_noise, global const float* disparity,
                           global const float* variance, global const uint* zbuffer,
                           global float* predicted_variance_bits) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);

  Landing landing;
  landing.y = -1;
  uint key = 0;
  float p = 0.0f;
  if (x < size.width) {
    const DisparityMotion motion = view == EGOSGM_LEFT ? left : right;
    const size_t source = index_of(size, view, x, y);
    landing = land(size, range, motion, x, y, disparity[source]);
    key = key_of(landing.disparity);
    p = predicted_variance(motion, landing, variance[source], process_noise);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (landing.y < 0) return;
  const size_t target = index_of(size, view, landing.x, landing.y);
  // Positive floats are ordered as their bits are.
  if (zbuffer[target] == key) atomic_max((global uint*)predicted_variance_bits + target, as_uint(p));
}

kernel void decode(const ImageSize size, global const uint* zbuffer, global float* disparity) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t i = index_of(size, get_global_id(2), x, get_global_id(1));
  disparity[i] = zbuffer[i] == 0 ? EGOSGM_INVALID_DISPARITY : disparity_of(zbuffer[i]);
}
