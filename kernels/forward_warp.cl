// SPDX-License-Identifier: Apache-2.0
// Forward warp of both views' disparity maps by the camera's motion (eqs. 1-6), nearest surface first.
//
// Several sources may land on one target. The largest disparity wins, of equal ones the one with the largest variance,
// so the result does not depend on the order in which they come. GPUs, a pixel a work-item: disparities bid by atomic
// maxima of keys that are ordered as they are, then variances do among the sources that reached the winner. CPUs, where
// atomics are slow: a work-item owns a band of target rows and looks through the source rows that reach into it.
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

typedef struct {
  Ints lands, x, y;  // 0, 0 where it lands nowhere
  Floats disparity, variance;
} Moved;

// Variance of the predicted disparity by the motion's covariance. u, v: relative to the principal point.
static inline Floats motion_variance(const DisparityMotion motion, const Floats u, const Floats v, const Floats d) {
  const Floats zero = 0.0f;
  const Floats by_disparity = motion.noise_dd * d + motion.noise_dx * u + motion.noise_dy * v;
  const Floats by_place = u * (motion.noise_xx * u + motion.noise_xy * v) + motion.noise_yy * v * v;
  const Floats q = d * d * (d * by_disparity + by_place);
  return q < zero ? zero : q;  // rounding
}

// Pixels x .. x + PIXELS - 1 of row y in the next frame.
static inline Moved move_pixels(const ImageSize size, const DisparityRange range, const DisparityMotion motion,
                                const float process_noise, const int x, const int y, const Floats disparity,
                                const Floats variance) {
  const Floats zero = 0.0f;
  const Floats one = 1.0f;
  const Floats least_ratio = EGOSGM_MIN_DEPTH_RATIO;
  const Floats most = EGOSGM_MAX_VARIANCE_PX2;
  const Floats wx = FLOATS_OF_INTS(x + LANE_INDICES) - motion.cx;
  const Floats wy = (Floats)((float)y - motion.cy);
  const Floats wd = disparity + motion.doffs;
  const Floats w = motion.w[0] * wx + motion.w[1] * wy + motion.w[2] * wd + motion.w[3];
  const Floats phi = one / w;
  const Floats u = (motion.x[0] * wx + motion.x[1] * wy + motion.x[2] * wd + motion.x[3]) * phi;
  const Floats v = (motion.y[0] * wx + motion.y[1] * wy + motion.y[2] * wd + motion.y[3]) * phi;
  const Floats metric_disparity = wd * phi;

  Moved moved;
  moved.disparity = metric_disparity - motion.doffs + 0.0f;  // + 0: there is one zero only
  // Asked of the floats, with comparisons that NaN fails, before any of them becomes an integer.
  const Floats target_x = nearest(u + motion.cx);
  const Floats target_y = nearest(v + motion.cy);
  moved.lands = (disparity > INVALID) & (w > least_ratio) & (target_x >= zero) & (target_x < (Floats)(size.width)) &
                (target_y >= zero) & (target_y < (Floats)(size.height)) & (moved.disparity >= (Floats)(range.min)) &
                (moved.disparity <= (Floats)(range.min + range.count - 1));
  moved.x = INTS_OF_FLOATS(moved.lands ? target_x : zero);
  moved.y = INTS_OF_FLOATS(moved.lands ? target_y : zero);
  const Floats p = phi * phi * variance + process_noise + motion_variance(motion, u, v, metric_disparity);
  moved.variance = p < most ? p : most;
  return moved;
}

#if PIXELS == 1

// Unsigned integers that are ordered as the floats are; 0 is none of them.
static inline uint key_of(const float disparity) {
  const uint bits = as_uint(disparity);
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}

static inline float disparity_of(const uint key) { return as_float(key >> 31 ? key & 0x7fffffffu : ~key); }

// Moves both views' disparity space. landed: the index of a source's target in the view, -1: nowhere. Also clears what
// the splats bid on.
kernel void move(const ImageSize size, const DisparityRange range, const DisparityMotion left,
                 const DisparityMotion right, const float process_noise, global const float* disparity,
                 global const float* variance, global int* landed, global uint* moved_key, global float* moved_variance,
                 global uint* zbuffer, global float* predicted_variance) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= size.width) return;
  const size_t i = ((size_t)view * size.height + y) * size.width + x;
  const DisparityMotion motion = view == EGOSGM_LEFT ? left : right;
  const Moved moved = move_pixels(size, range, motion, process_noise, x, y, disparity[i], variance[i]);
  landed[i] = moved.lands ? moved.y * size.width + moved.x : -1;
  moved_key[i] = key_of(moved.disparity);
  moved_variance[i] = moved.variance;
  zbuffer[i] = 0;
  predicted_variance[i] = 0.0f;
}

kernel void splat_disparity(const ImageSize size, global const int* landed, global const uint* moved_key,
                            global uint* zbuffer) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t first = (size_t)get_global_id(2) * size.width * size.height;
  const size_t i = first + (size_t)get_global_id(1) * size.width + x;
  const uint target = landed[i];  // -1 is above all
  if (target < (uint)(size.width * size.height)) atomic_max(&zbuffer[first + target], moved_key[i]);
}

// Positive floats are ordered as their bits are.
kernel void splat_variance(const ImageSize size, global const int* landed, global const uint* moved_key,
                           global const float* moved_variance, global const uint* zbuffer,
                           global float* predicted_variance) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t first = (size_t)get_global_id(2) * size.width * size.height;
  const size_t i = first + (size_t)get_global_id(1) * size.width + x;
  const uint target = landed[i];
  if (target >= (uint)(size.width * size.height) || zbuffer[first + target] != moved_key[i]) return;
  atomic_max((global uint*)predicted_variance + first + target, as_uint(moved_variance[i]));
}

kernel void decode(const ImageSize size, global const uint* zbuffer, global float* disparity) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * size.width + x;
  disparity[i] = zbuffer[i] == 0 ? EGOSGM_INVALID_DISPARITY : disparity_of(zbuffer[i]);
}

#else

// The first and the last row that each source row lands on; the first lies behind the last where it lands on none. A
// work-item a row and view.
kernel void find_spans(const ImageSize size, const DisparityRange range, const DisparityMotion left,
                       const DisparityMotion right, global const float* disparity, global int* spans) {
  const int y = get_global_id(0);
  const int view = get_global_id(1);
  const size_t row = (size_t)view * size.height + y;
  const DisparityMotion motion = view == EGOSGM_LEFT ? left : right;
  Ints first = size.height;
  Ints last = -1;
  for (int x = 0; x < size.width; x += PIXELS) {
    const Floats d = load_pixels(disparity + row * size.width, x, size.width);
    const Moved moved = move_pixels(size, range, motion, 0.0f, x, y, d, 0.0f);
    first = (moved.lands & (moved.y < first)) ? moved.y : first;
    last = (moved.lands & (moved.y > last)) ? moved.y : last;
  }
  int firsts[PIXELS];
  int lasts[PIXELS];
  vstore16(first, 0, firsts);
  vstore16(last, 0, lasts);
  for (int i = 1; i < PIXELS; ++i) {
    firsts[0] = min(firsts[0], firsts[i]);
    lasts[0] = max(lasts[0], lasts[i]);
  }
  spans[2 * row] = firsts[0];
  spans[2 * row + 1] = lasts[0];
}

// Moves and splats what lands on a band of `band_rows` rows. A work-item a band and view; no other touches its rows.
kernel void splat_bands(const ImageSize size, const DisparityRange range, const DisparityMotion left,
                        const DisparityMotion right, const float process_noise, const int band_rows,
                        global const int* spans, global const float* disparity, global const float* variance,
                        global float* predicted, global float* predicted_variance) {
  const int view = get_global_id(1);
  const int width = size.width;
  const int first = get_global_id(0) * band_rows;
  const int end = min(first + band_rows, size.height);
  const DisparityMotion motion = view == EGOSGM_LEFT ? left : right;
  const size_t rows = (size_t)view * size.height;
  global float* band = predicted + (rows + first) * width;
  global float* band_variance = predicted_variance + (rows + first) * width;
  const int pixels = (end - first) * width;
  for (int i = 0; i < pixels; i += PIXELS) {
    store_pixels(INVALID, band, i, pixels);
    store_pixels(0.0f, band_variance, i, pixels);
  }
  for (int y = 0; y < size.height; ++y) {
    if (spans[2 * (rows + y)] >= end || spans[2 * (rows + y) + 1] < first) continue;
    const size_t row = (rows + y) * width;
    for (int x = 0; x < width; x += PIXELS) {
      const Floats d = load_pixels(disparity + row, x, width);
      const Floats p = load_pixels(variance + row, x, width);
      const Moved moved = move_pixels(size, range, motion, process_noise, x, y, d, p);
      const Ints lands = moved.lands & (moved.y >= (Ints)(first)) & (moved.y < (Ints)(end));
      int targets[PIXELS];
      float disparities[PIXELS];
      float variances[PIXELS];
      vstore16(lands ? (moved.y - first) * width + moved.x : (Ints)(-1), 0, targets);
      vstore16(moved.disparity, 0, disparities);
      vstore16(moved.variance, 0, variances);
      for (int i = 0; i < PIXELS; ++i) {
        const int target = targets[i];
        if (target < 0) continue;
        const float winner = band[target];
        if (disparities[i] > winner || (disparities[i] == winner && variances[i] > band_variance[target])) {
          band[target] = disparities[i];
          band_variance[target] = variances[i];
        }
      }
    }
  }
}

#endif
