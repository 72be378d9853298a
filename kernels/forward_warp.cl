// SPDX-License-Identifier: Apache-2.0
// Forward warp of both views' disparity maps by the camera's motion (eqs. 1-6), nearest surface first.
//
// Several sources may land on one target. Disparities bid by atomic maxima of keys that are ordered as they are, then
// variances do among the sources that reached the winner, so the result does not depend on the order in which
// work-items run.
#include "shared.h"

// Unsigned integers that are ordered as the floats are; 0 is none of them.
static inline uint key_of(const float disparity) {
  const uint bits = as_uint(disparity);
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}

static inline float disparity_of(const uint key) { return as_float(key >> 31 ? key & 0x7fffffffu : ~key); }

// Variance of the predicted disparity by the motion's covariance. u, v: relative to the principal point.
static inline float motion_variance(const DisparityMotion motion, const float u, const float v, const float d) {
  const float by_disparity = motion.noise_dd * d + motion.noise_dx * u + motion.noise_dy * v;
  const float by_place = u * (motion.noise_xx * u + motion.noise_xy * v) + motion.noise_yy * v * v;
  const float q = d * d * (d * by_disparity + by_place);
  return q < 0.0f ? 0.0f : q;  // rounding
}

// Moves a view's disparity space. landed: the index of a source's target in the view, -1: nowhere. Also clears what the
// splats bid on. For CPUs it is apart from the atomics, which are no vector code, and free of branches.
kernel void move(const ImageSize size, const DisparityRange range, const int view, const DisparityMotion motion,
                 const float process_noise, global const float* disparity, global const float* variance,
                 global int* landed, global uint* moved_key, global float* moved_variance, global uint* zbuffer,
                 global float* predicted_variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  if (x >= size.width) return;
  const size_t i = ((size_t)view * size.height + y) * size.width + x;

  const float wx = (float)x - motion.cx;
  const float wy = (float)y - motion.cy;
  const float wd = disparity[i] + motion.doffs;
  const float w = motion.w[0] * wx + motion.w[1] * wy + motion.w[2] * wd + motion.w[3];
  const float phi = 1.0f / w;
  const float u = (motion.x[0] * wx + motion.x[1] * wy + motion.x[2] * wd + motion.x[3]) * phi;
  const float v = (motion.y[0] * wx + motion.y[1] * wy + motion.y[2] * wd + motion.y[3]) * phi;
  const float metric_disparity = wd * phi;
  const float moved = metric_disparity - motion.doffs + 0.0f;  // + 0: there is one zero only

  // Asked of the floats, with comparisons that NaN fails, before any of them becomes an integer.
  const float target_x = rint(u + motion.cx);
  const float target_y = rint(v + motion.cy);
  const int lands = (disparity[i] > EGOSGM_INVALID_DISPARITY) & (w > EGOSGM_MIN_DEPTH_RATIO) & (target_x >= 0.0f) &
                    (target_x < (float)size.width) & (target_y >= 0.0f) & (target_y < (float)size.height) &
                    (moved >= (float)range.min) & (moved <= (float)(range.min + range.count - 1));
  const int target = (int)(lands ? target_y : 0.0f) * size.width + (int)(lands ? target_x : 0.0f);
  landed[i] = lands ? target : -1;
  moved_key[i] = key_of(moved);
  const float p = phi * phi * variance[i] + process_noise + motion_variance(motion, u, v, metric_disparity);
  moved_variance[i] = p < EGOSGM_MAX_VARIANCE_PX2 ? p : EGOSGM_MAX_VARIANCE_PX2;
  zbuffer[i] = 0;
  predicted_variance[i] = 0.0f;
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
                           global const float* moved_variance, global const uint* zbuffer,
                           global float* predicted_variance) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t first = (size_t)get_global_id(2) * size.width * size.height;
  const size_t i = first + (size_t)get_global_id(1) * size.width + x;
  const int target = landed[i];
  if (target < 0 || zbuffer[first + target] != moved_key[i]) return;
  atomic_max((global uint*)predicted_variance + first + target, as_uint(moved_variance[i]));
}

kernel void decode(const ImageSize size, global const uint* zbuffer, global float* disparity) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * size.width + x;
  disparity[i] = zbuffer[i] == 0 ? EGOSGM_INVALID_DISPARITY : disparity_of(zbuffer[i]);
}
