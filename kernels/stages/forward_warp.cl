// SPDX-License-Identifier: Apache-2.0
// Forward warp of both views' disparity maps by the camera's motion (eqs. 1-6), nearest surface first.
//
// A source lands between rows, and gives the row on which it is counted the disparity that its surface has there:
// between its own and that of the row beside it. Several sources may land on one target. The largest disparity wins, of
// equal ones the one with the largest variance, so the result does not depend on the order in which they come; its
// evidence is the most that such a source has. What came nearer than the range still hides what is behind it: such a
// target has no disparity, and is marked as hidden. GPUs, a pixel a work-item: disparities bid by atomic maxima of keys
// that are ordered as they are, then variances do among the sources that reached the winner. CPUs, where atomics are
// slow: a work-item owns a band of target rows and looks through the source rows that reach into it.
#include "method.h"
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

static inline Floats load_row(const ImageSize size, global const float* map, const int x, const int y) {
  return y >= 0 && y < size.height ? load_pixels(map + (size_t)y * size.width, x, size.width) : INVALID;
}

// Pixels x .. x + PIXELS - 1 of row y in the next frame. `disparities`: of the view.
static inline Moved move_pixels(const ImageSize size, const DisparityRange range, const DisparityMotion motion,
                                const float process_noise, const int x, const int y, global const float* disparities,
                                const Floats variance) {
  const Floats disparity = load_row(size, disparities, x, y);
  const Floats above = load_row(size, disparities, x, y - motion.row_step);
  const Floats below = load_row(size, disparities, x, y + motion.row_step);
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
  // Asked of the floats, with comparisons that NaN fails, before any of them becomes an integer.
  const Floats target_x = nearest(u + motion.cx);
  const float rows = motion.row_step;
  const Floats row = (v + motion.cy) * (1.0f / rows), nearest_row = nearest(row);
  const Floats target_y = rows * nearest_row;

  const Floats beside = row < nearest_row ? below : above, change = beside - disparity;
  const Ints is_one_surface = (beside > INVALID) & (fabs(change) <= (Floats)(EGOSGM_ROWS_AGREE_PX));
  const Floats correction = is_one_surface ? fabs(nearest_row - row) * change : zero;
  Moved moved;
  moved.disparity = metric_disparity + correction - motion.doffs + 0.0f;  // + 0: there is one zero only
  moved.lands = (disparity > INVALID) & (w > least_ratio) & (target_x >= zero) & (target_x < (Floats)(size.width)) &
                (target_y >= zero) & (target_y < (Floats)(size.height)) & (moved.disparity >= (Floats)(range.min));
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
KERNEL void move(const ImageSize size, const DisparityRange range, const DisparityMotion left,
                 const DisparityMotion right, const float process_noise, global const float* disparity,
                 global const float* variance, global int* landed, global uint* moved_key, global float* moved_variance,
                 global uint* zbuffer, global float* predicted_variance, global uint* most_evidence) {
  const int x = get_global_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  if (x >= size.width) return;
  const size_t i = ((size_t)view * size.height + y) * size.width + x;
  const DisparityMotion motion = view == EGOSGM_LEFT ? left : right;
  const Moved moved = move_pixels(size, range, motion, process_noise, x, y,
                                  disparity + (size_t)view * size.height * size.width, variance[i]);
  landed[i] = moved.lands && y % motion.row_step == 0 ? moved.y * size.width + moved.x : -1;
  moved_key[i] = key_of(moved.disparity);
  moved_variance[i] = moved.variance;
  zbuffer[i] = 0;
  predicted_variance[i] = 0.0f;
  most_evidence[i] = 0;
}

KERNEL void splat_disparity(const ImageSize size, global const int* landed, global const uint* moved_key,
                            global uint* zbuffer) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t first = (size_t)get_global_id(2) * size.width * size.height;
  const size_t i = first + (size_t)get_global_id(1) * size.width + x;
  const uint target = landed[i];  // -1 is above all
  if (target < (uint)(size.width * size.height)) atomic_max(&zbuffer[first + target], moved_key[i]);
}

// Positive floats are ordered as their bits are.
KERNEL void splat_variance(const ImageSize size, global const int* landed, global const uint* moved_key,
                           global const float* moved_variance, global const uint* zbuffer,
                           global float* predicted_variance, global const uchar* evidence, global uint* most_evidence) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t first = (size_t)get_global_id(2) * size.width * size.height;
  const size_t i = first + (size_t)get_global_id(1) * size.width + x;
  const uint target = landed[i];
  if (target >= (uint)(size.width * size.height) || zbuffer[first + target] != moved_key[i]) return;
  atomic_max((global uint*)predicted_variance + first + target, as_uint(moved_variance[i]));
  atomic_max(most_evidence + first + target, evidence[i]);
}

KERNEL void decode_warped(const ImageSize size, const DisparityRange range, global const uint* zbuffer,
                          global float* disparity, global float* variance, global const uint* most_evidence,
                          global uchar* evidence) {
  const int x = get_global_id(0);
  if (x >= size.width) return;
  const size_t i = ((size_t)get_global_id(2) * size.height + get_global_id(1)) * size.width + x;
  const float d = zbuffer[i] == 0 ? EGOSGM_INVALID_DISPARITY : disparity_of(zbuffer[i]);
  const int is_beyond = d > range.min + range.count - 1;
  disparity[i] = is_beyond ? EGOSGM_INVALID_DISPARITY : d;
  if (is_beyond) variance[i] = EGOSGM_HIDDEN;
  evidence[i] = (uchar)most_evidence[i];
}

#else

// The row on which a pixel lands, as a real number; `w` by which its depth shrinks.
static inline float row_of(const DisparityMotion motion, const float wx, const float wy, const float wd, float* w) {
  *w = motion.w[0] * wx + motion.w[1] * wy + motion.w[2] * wd + motion.w[3];
  return (motion.y[0] * wx + motion.y[1] * wy + motion.y[2] * wd + motion.y[3]) / *w + motion.cy;
}

// Rows between which everything lands that a source row's valid disparities [least, most] can land on: the quotient of
// two linear functions has its extremes in the corners of (x, disparity) where its denominator keeps its sign. A step
// more on both sides for the rounding; every row where a corner comes near the camera, which makes more of it.
static inline int2 span_of(const ImageSize size, const DisparityMotion motion, const int y, const float least,
                           const float most) {
  float first = INFINITY;
  float last = -INFINITY;
  for (int corner = 0; corner < 4; ++corner) {
    const float wx = (corner & 1 ? size.width - 1 : 0) - motion.cx;
    const float wd = (corner & 2 ? most : least) + motion.doffs;
    float w;
    const float row = row_of(motion, wx, (float)y - motion.cy, wd, &w);
    if (!(w > 0.01f) || !(fabs(row) < 1e6f)) return (int2)(0, size.height - 1);
    first = fmin(first, row);
    last = fmax(last, row);
  }
  return (int2)((int)floor(first) - motion.row_step, (int)ceil(last) + motion.row_step);
}

// Between which rows each source row lands; the first lies behind the last where it lands on none. A work-item a row
// and view.
COMPILED_ONCE void find_spans_row(const WorkItem at, const ImageSize size, const DisparityMotion left,
                                  const DisparityMotion right, global const float* disparity, global int* spans) {
  const int y = at.x;
  const int view = at.y;
  const size_t row = (size_t)view * size.height + y;
  const DisparityMotion motion = view == EGOSGM_LEFT ? left : right;
  const int width = y % motion.row_step == 0 ? size.width : 0;
  Floats least = INFINITY;
  Floats most = INVALID;
  for (int x = 0; x < width; x += PIXELS) {
    const Floats d = load_pixels(disparity + row * size.width, x, size.width);
    const Floats valid_or_most = d > INVALID ? d : (Floats)(INFINITY);
    least = valid_or_most < least ? valid_or_most : least;
    most = d > most ? d : most;
  }
  float leasts[PIXELS];
  float mosts[PIXELS];
  vstore16(least, 0, leasts);
  vstore16(most, 0, mosts);
  for (int i = 1; i < PIXELS; ++i) {
    leasts[0] = fmin(leasts[0], leasts[i]);
    mosts[0] = fmax(mosts[0], mosts[i]);
  }
  const bool has_any = mosts[0] > EGOSGM_INVALID_DISPARITY;
  const int2 span = has_any ? span_of(size, motion, y, leasts[0], mosts[0]) : (int2)(size.height, -1);
  spans[2 * row] = span.x;
  spans[2 * row + 1] = span.y;
}

KERNEL void find_spans(const ImageSize size, const DisparityMotion left, const DisparityMotion right,
                       global const float* disparity, global int* spans) {
  find_spans_row(THIS_WORK_ITEM, size, left, right, disparity, spans);
}

// Moves and splats what lands on a band of `band_rows` rows. A work-item a view and band; no other touches its rows.
// The views go by turns, as bands of rows that are skipped take less time, and work-items are dealt out by halves.
COMPILED_ONCE void splat_bands_row(const WorkItem at, const ImageSize size, const DisparityRange range,
                                   const DisparityMotion left, const DisparityMotion right, const float process_noise,
                                   const int band_rows, global const int* spans, global const float* disparity,
                                   global const float* variance, global const uchar* evidence, global float* predicted,
                                   global float* predicted_variance, global uchar* predicted_evidence) {
  const int view = at.x;
  const int width = size.width;
  const int first = at.y * band_rows;
  const int end = min(first + band_rows, size.height);
  const DisparityMotion motion = view == EGOSGM_LEFT ? left : right;
  const size_t rows = (size_t)view * size.height;
  global float* band = predicted + (rows + first) * width;
  global float* band_variance = predicted_variance + (rows + first) * width;
  global uchar* band_evidence = predicted_evidence + (rows + first) * width;
  const int begin = (first + motion.row_step - 1) / motion.row_step * motion.row_step;
  for (int y = begin; y < end; y += motion.row_step) {
    const size_t row = (size_t)(y - first) * width;
    for (int x = 0; x < width; x += PIXELS) {
      store_pixels(INVALID, band + row, x, width);
      store_pixels(0.0f, band_variance + row, x, width);
      store_bytes(0, band_evidence + row, x, width);
    }
  }
  for (int y = 0; y < size.height; ++y) {
    if (spans[2 * (rows + y)] >= end || spans[2 * (rows + y) + 1] < first) continue;
    const size_t row = (rows + y) * width;
    for (int start = 0; start < width; start += PIXELS * CHUNK) {
      Ints targets[CHUNK];
      Floats disparities[CHUNK], variances[CHUNK];
      FOR_BLOCKS(x, i, start, width) {
        const Floats p = load_pixels(variance + row, x, width);
        const Moved moved = move_pixels(size, range, motion, process_noise, x, y, disparity + rows * width, p);
        const Ints lands = moved.lands & (moved.y >= (Ints)(first)) & (moved.y < (Ints)(end));
        targets[i] = lands ? (moved.y - first) * width + moved.x : (Ints)(-1);
        disparities[i] = moved.disparity;
        variances[i] = moved.variance;
      }
      for (int i = 0; i < min(PIXELS * CHUNK, width - start); ++i) {
        const int target = LANE(int, targets, i);
        if (target < 0) continue;
        const float d = LANE(float, disparities, i), p = LANE(float, variances, i);
        const uchar of_source = evidence[row + start + i];
        if (d > band[target]) {
          band[target] = d;
          band_variance[target] = p;
          band_evidence[target] = of_source;
        } else if (d == band[target]) {
          band_variance[target] = fmax(band_variance[target], p);
          band_evidence[target] = max(band_evidence[target], of_source);
        }
      }
    }
  }
  for (int y = begin; y < end; y += motion.row_step) {
    global float *row = band + (size_t)(y - first) * width, *row_variance = band_variance + (size_t)(y - first) * width;
    for (int x = 0; x < width; x += PIXELS) {
      const Floats d = load_pixels(row, x, width);
      const Ints is_beyond = d > (Floats)(range.min + range.count - 1);
      if (!any_of(is_beyond)) continue;
      store_pixels(is_beyond ? INVALID : d, row, x, width);
      store_pixels(is_beyond ? (Floats)(EGOSGM_HIDDEN) : load_pixels(row_variance, x, width), row_variance, x, width);
    }
  }
}

KERNEL void splat_bands(const ImageSize size, const DisparityRange range, const DisparityMotion left,
                        const DisparityMotion right, const float process_noise, const int band_rows,
                        global const int* spans, global const float* disparity, global const float* variance,
                        global const uchar* evidence, global float* predicted, global float* predicted_variance,
                        global uchar* predicted_evidence) {
  splat_bands_row(THIS_WORK_ITEM, size, range, left, right, process_noise, band_rows, spans, disparity, variance,
                  evidence, predicted, predicted_variance, predicted_evidence);
}

#endif
