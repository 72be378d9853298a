// SPDX-License-Identifier: Apache-2.0
// The variance that is given out: what measurement and filter say of the surroundings of a pixel, how rough the
// disparities around it are, and how far they jump beside it. Most surfaces are planes, whose disparities have no
// second difference; where those around a pixel have, or where there are holes, it is likely to be wrong. Beside a jump
// it may lie on the wrong side.
#include "method.h"
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

static inline Floats cut(const Floats value, const float most) { return value < most ? value : (Floats)(most); }

// Values outside of the image are negative.
static inline Floats counted(const Floats value) { return value >= 0.0f ? (Floats)(1.0f) : (Floats)(0.0f); }
static inline Floats if_inside(const Floats value) { return value >= 0.0f ? value : (Floats)(0.0f); }

// A variance without a disparity means nothing.
static inline Floats if_valid(const Floats d, const Floats variance) { return is_valid(d) ? variance : (Floats)(0.0f); }

// |before - 2 at + after|; beside a hole as much as can be.
static inline Floats second_difference(const Floats before, const Floats at, const Floats after) {
  const Ints valid = is_valid(before) & is_valid(at) & is_valid(after);
  return valid ? cut(fabs((before + after) - 2.0f * at), EGOSGM_MAX_ROUGHNESS_PX) : (Floats)(EGOSGM_MAX_ROUGHNESS_PX);
}

// (p r^3)^(1/4), each cut; with nothing measured r is all that it may be. The filter takes the errors of its
// measurements for independent; those of one surface are not, so that p falls from frame to frame and the errors
// hardly.
static inline Floats blend(const Floats p, const Floats measured, const Floats r) {
  const Floats most = EGOSGM_MAX_MEAN_VARIANCE_PX2;
  const Floats cut_r = is_valid(measured) ? cut(r, EGOSGM_MAX_MEAN_VARIANCE_PX2) : most;
  return sqrt(cut_r * sqrt(cut_r * cut(p, EGOSGM_MAX_MEAN_VARIANCE_PX2)));
}

// For each pixel: the variances' blend, and the sum of the horizontal second difference and of what the vertical one is
// of a row. A pixel at the image's edge is its own neighbour.
COMPILED_ONCE void of_each_pixel_row(const WorkItem at, const ImageSize size, const int row_step,
                                     global const float* disparity, global const float* belief,
                                     global const float* variance, global const float* measured,
                                     global const float* measured_variance, global float* blended,
                                     global float* roughness) {
  if (!has_row(at, row_step)) return;
  const int y = at.y, width = size.width, stride = row_step * width;
  const size_t row = ((size_t)at.view * size.height + y) * width;
  global const float* above = disparity + (y >= row_step ? row - stride : row);
  global const float* below = disparity + (y + row_step < size.height ? row + stride : row);
  FOR_PIXELS(x, width) {
    const Ints at = x + LANE_INDICES;
    const Floats d = load_pixels(disparity + row, x, width);
    const Floats left = at > 0 ? load_pixels(disparity + row, x - 1, width) : d;
    const Floats right = at < width - 1 ? load_pixels(disparity + row, x + 1, width) : d;
    const Floats across = second_difference(left, d, right);
    const Floats down = second_difference(load_pixels(above, x, width), d, load_pixels(below, x, width));
    store_pixels(across + down * (1.0f / row_step), roughness + row, x, width);
    const Floats p = if_valid(load_pixels(belief + row, x, width), load_pixels(variance + row, x, width));
    const Floats r = load_pixels(measured_variance + row, x, width);
    store_pixels(blend(p, load_pixels(measured + row, x, width), r), blended + row, x, width);
  }
}

KERNEL void of_each_pixel(const ImageSize size, const int row_step, global const float* disparity,
                          global const float* belief, global const float* variance, global const float* measured,
                          global const float* measured_variance, global float* blended, global float* roughness) {
  of_each_pixel_row(THIS_WORK_ITEM, size, row_step, disparity, belief, variance, measured, measured_variance, blended,
                    roughness);
}

// Means along the row: of the variances at every fourth pixel; of the roughness at every pixel.
COMPILED_ONCE void row_means_row(const WorkItem at, const ImageSize size, const int row_step,
                                 global const float* variance, global const float* roughness,
                                 global float* mean_variance, global float* mean_roughness) {
  if (!has_row(at, row_step)) return;
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + at.y) * width;
  FOR_PIXELS(x, width) {
    Floats sum = 0.0f;
    Floats count = 0.0f;
    for (int u = -EGOSGM_VARIANCE_RADIUS; u <= EGOSGM_VARIANCE_RADIUS; u += EGOSGM_VARIANCE_STEP) {
      const Floats p = load_pixels(variance + row, x + u, width);
      sum += if_inside(p);
      count += counted(p);
    }
    store_pixels(sum / count, mean_variance + row, x, width);

    sum = 0.0f;
    count = 0.0f;
    for (int u = -EGOSGM_ROUGHNESS_RADIUS; u <= EGOSGM_ROUGHNESS_RADIUS; ++u) {
      const Floats r = load_pixels(roughness + row, x + u, width);
      sum += if_inside(r);
      count += counted(r);
    }
    store_pixels(sum / count, mean_roughness + row, x, width);
  }
}

KERNEL void row_means(const ImageSize size, const int row_step, global const float* variance,
                      global const float* roughness, global float* mean_variance, global float* mean_roughness) {
  row_means_row(THIS_WORK_ITEM, size, row_step, variance, roughness, mean_variance, mean_roughness);
}

// Mean of every STEP-th row within the radius, of those that are there. The numbers are constants, so that loops
// can be unrolled.
#define COLUMN_MEAN(NAME, RADIUS, STEP)                                                                      \
  static inline Floats NAME(global const float* view, const ImageSize size, const int row_step, const int x, \
                            const int y) {                                                                   \
    Floats sum = 0.0f;                                                                                       \
    float count = 0.0f;                                                                                      \
    _Pragma("unroll") for (int i = -RADIUS; i <= RADIUS; i += STEP) {                                        \
      if (i % row_step != 0 || y + i < 0 || y + i >= size.height) continue;                                  \
      sum += load_pixels(view + (size_t)(y + i) * size.width, x, size.width);                                \
      count += 1.0f;                                                                                         \
    }                                                                                                        \
    return sum / count;                                                                                      \
  }
COLUMN_MEAN(column_mean_of_variance, EGOSGM_VARIANCE_RADIUS, EGOSGM_VARIANCE_STEP)
COLUMN_MEAN(column_mean_of_roughness, EGOSGM_ROUGHNESS_RADIUS, 1)

// The largest of the differences to the disparities EGOSGM_JUMP_DISTANCE pixels off.
static inline Floats jump_beside(global const float* view, const ImageSize size, const int row_step, const int x,
                                 const int y, const Floats d) {
  Floats most = 0.0f;
#pragma unroll
  for (int i = -EGOSGM_JUMP_DISTANCE; i <= EGOSGM_JUMP_DISTANCE; i += EGOSGM_JUMP_DISTANCE) {
    const int v = y + i;
    if (i % row_step != 0 || v < 0 || v >= size.height) continue;
#pragma unroll
    for (int u = -EGOSGM_JUMP_DISTANCE; u <= EGOSGM_JUMP_DISTANCE; u += EGOSGM_JUMP_DISTANCE) {
      const Floats other = load_pixels(view + (size_t)v * size.width, x + u, size.width);
      const Floats difference = fabs(other - d);
      most = (is_valid(other) & (difference > most)) ? difference : most;
    }
  }
  return cut(most, EGOSGM_MAX_JUMP_PX);
}

// Keeps the order of the sums; none is too small or too large for it.
static inline Floats calibrated(const Floats sum) {
  const Floats square = sum * sum;
  const Floats right = EGOSGM_RIGHT_SURFACE_PX2 / (1.0f + EGOSGM_RIGHT_SURFACE_HALF / square);
  return right + EGOSGM_WRONG_SURFACE_PX2 * sqrt(sum) / (1.0f + EGOSGM_WRONG_SURFACE_HALF / (square * square * sum));
}

COMPILED_ONCE void combine_row(const WorkItem at, const ImageSize size, const int row_step, const float scale,
                               const float roughness_weight, const float jump_weight, global const float* disparity,
                               global const float* mean_variance, global const float* mean_roughness,
                               global float* variance) {
  if (!has_row(at, row_step)) return;
  const int y = at.y;
  const int width = size.width;
  const size_t view = (size_t)at.view * size.height * width;
  const size_t row = view + (size_t)y * width;
  FOR_CHUNKS(start, width) {
    Floats sums[CHUNK], jumps[CHUNK];
    FOR_BLOCKS(x, i, start, width) {
      jumps[i] = jump_beside(disparity + view, size, row_step, x, y, load_pixels(disparity + row, x, width));
    }
    FOR_BLOCKS(x, i, start, width) {
      const Floats p = column_mean_of_variance(mean_variance + view, size, row_step, x, y);
      const Floats r = column_mean_of_roughness(mean_roughness + view, size, row_step, x, y);
      const Floats j = jumps[i];
      sums[i] = scale * (p * sqrt(p)) + roughness_weight * (r * r) + jump_weight * (j * j);
    }
    FOR_BLOCKS(x, i, start, width) {
      const Floats d = load_pixels(disparity + row, x, width);
      store_pixels(if_valid(d, calibrated(sums[i])), variance + row, x, width);
    }
  }
}

KERNEL void combine(const ImageSize size, const int row_step, const float scale, const float roughness_weight,
                    const float jump_weight, global const float* disparity, global const float* mean_variance,
                    global const float* mean_roughness, global float* variance) {
  combine_row(THIS_WORK_ITEM, size, row_step, scale, roughness_weight, jump_weight, disparity, mean_variance,
              mean_roughness, variance);
}

// The filter's own variance.
COMPILED_ONCE void keep_row(const WorkItem at, const ImageSize size, const int row_step, global const float* disparity,
                            global const float* variance, global float* kept) {
  if (!has_row(at, row_step)) return;
  const int width = size.width;
  const size_t row = ((size_t)at.view * size.height + at.y) * width;
  FOR_PIXELS(x, width) {
    const Floats d = load_pixels(disparity + row, x, width);
    store_pixels(if_valid(d, load_pixels(variance + row, x, width)), kept + row, x, width);
  }
}

KERNEL void keep(const ImageSize size, const int row_step, global const float* disparity, global const float* variance,
                 global float* kept) {
  keep_row(THIS_WORK_ITEM, size, row_step, disparity, variance, kept);
}
