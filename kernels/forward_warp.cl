// SPDX-License-Identifier: Apache-2.0
// Forward warp of both views' disparity maps by the camera's motion (eqs. 1-6), nearest surface first.
//
// Several sources may land on one target. Disparities bid by atomic maxima of keys that are ordered as they are, then
// variances do among the sources that reached the winner, so the result does not depend on the order in which
// work-items run.
#include "shared.h"

// What becomes of a source. target: its index in its view, -1: nowhere. u, v: where it lands, relative to the principal
// point.
typedef struct {
  int target;
  float u, v;
  float disparity, metric_disparity, phi;
} Landing;

static inline float row_times(const float* row, const float wx, const float wy, const float wd) {
  return row[0] * wx + row[1] * wy + row[2] * wd + row[3];
}

// Combines conditions with & for CPUs: without branches, the loop over a work-group's pixels becomes vector code.
static inline Landing land(const ImageSize size, const DisparityRange range, const DisparityMotion motion, const int x,
                           const int y, const float disparity) {
  const float wx = (float)x - motion.cx;
  const float wy = (float)y - motion.cy;
  const float wd = disparity + motion.doffs;
  const float w = row_times(motion.w, wx, wy, wd);

  Landing landing;
  landing.phi = 1.0f / w;
  landing.u = row_times(motion.x, wx, wy, wd) * landing.phi;
  landing.v = row_times(motion.y, wx, wy, wd) * landing.phi;
  landing.metric_disparity = wd * landing.phi;
  landing.disparity = landing.metric_disparity - motion.doffs + 0.0f;  // + 0: there is one zero only

  // Asked of the floats, with comparisons that NaN fails, before any of them becomes an integer.
  const float target_x = rint(landing.u + motion.cx);
  const float target_y = rint(landing.v + motion.cy);
  const int lands = (disparity > EGOSGM_INVALID_DISPARITY) & (w > EGOSGM_MIN_DEPTH_RATIO) & (target_x >= 0.0f) &
                    (target_x < (float)size.width) & (target_y >= 0.0f) & (target_y < (float)size.height) &
                    (landing.disparity >= (float)range.min) &
                    (landing.disparity <= (float)(range.min + range.count - 1));
  const int target = (int)(lands ? target_y : 0.0f) * size.width + (int)(lands ? target_x : 0.0f);
  landing.target = lands ? target : -1;
  return landing;
}

// Variance of the predicted disparity by the motion's covariance: (d'^2 / (fx b))^2 Var(Z'), Z' = (1, X', Y') form,
// with X' and Y' multiplied out so that nothing is divided by a disparity near zero.
static inline float motion_variance(const DisparityMotion motion, const Landing landing) {
  const float d = landing.metric_disparity;
  const float a = d * d / motion.fx_baseline;
  const float bx = d * landing.u / motion.fx;
  const float by = d * landing.v / motion.fy;
  const float q = a * a * motion.noise_1 + a * bx * motion.noise_x + a * by * motion.noise_y +
                  bx * bx * motion.noise_xx + bx * by * motion.noise_xy + by * by * motion.noise_yy;
  return q < 0.0f ? 0.0f : q;  // rounding
}

static inline float predicted_variance(const DisparityMotion motion, const Landing landing, const float variance,
                                       const float process_noise) {
  const float p = landing.phi * landing.phi * variance + process_noise + motion_variance(motion, landing);
  return p < EGOSGM_MAX_VARIANCE_PX2 ? p : EGOSGM_MAX_VARIANCE_PX2;
}

// Unsigned integers that are ordered as the floats are; 0 is none of them.
static inline uint key_of(const float disparity) {
  const uint bits = as_uint(disparity);
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}

static inline float disparity_of(const uint key) { return as_float(key >> 31 ? key & 0x7fffffffu : ~key); }

// landed: the index of a source's target in its view, -1: nowhere. Apart from the atomics, which are no vector code on
// CPUs.
kernel void move(const ImageSize size, const DisparityRange range, const int view, const DisparityMotion motion,
                 const float process_noise, global const float* disparity, global const float* variance,
                 global int* landed, global uint* moved_key, global float* moved_variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  if (x >= size.width) return;
  const size_t i = ((size_t)view * size.height + y) * size.width + x;
  const Landing landing = land(size, range, motion, x, y, disparity[i]);
  landed[i] = landing.target;
  moved_key[i] = key_of(landing.disparity);
  moved_variance[i] = predicted_variance(motion, landing, variance[i], process_noise);
}

kernel void splat_disparity(const ImageSize size, global const int* landed, global const uint* moved_key,
                            global uint* zbuffer) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t first = (size_t)get_global_id(2) * size.width * size.height;
  const size_t i = first + (size_t)get_global_id(1) * size.width + x;
  const int target = landed[i];
  if (target >= 0) atomic_max(&zbuffer[first + target], moved_key[i]);
}

// Positive floats are ordered as their bits are.
kernel void splat_variance(const ImageSize size, global const int* landed, global const uint* moved_key,
                           global const float* moved_variance, global const uint* zbuffer, global float* variance) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t first = (size_t)get_global_id(2) * size.width * size.height;
  const size_t i = first + (size_t)get_global_id(1) * size.width + x;
  const int target = landed[i];
  if (target < 0 || zbuffer[first + target] != moved_key[i]) return;
  atomic_max((global uint*)variance + first + target, as_uint(moved_variance[i]));
}

kernel void decode(const ImageSize size, global const uint* zbuffer, global float* disparity) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * size.width + x;
  disparity[i] = zbuffer[i] == 0 ? EGOSGM_INVALID_DISPARITY : disparity_of(zbuffer[i]);
}
