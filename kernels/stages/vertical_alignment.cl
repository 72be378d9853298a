// SPDX-License-Identifier: Apache-2.0
// The vertical offset dy between the rows of the views: I(x, y) = J(x - d, y + dy), left image I, right image J; a
// quadratic of the place in the right image, since what is left of a rotation or of the lenses grows to the corners.
//
// With the right image resampled by the offsets known so far, what is left of them minimises the sum of Huber's
// function of r = I(x, y) - J(x - d, y + step) over the pixels; a Newton step solves sum(g_I g_J b b^T) step = sum(g
// clamp(r) b), the former where r is not clamped, with b the quadratic's terms, and g the mean of the vertical
// gradients g_I and g_J (after Lucas and Kanade 1981). Smoothed rows for r, g of both images, and the product of the
// two gradients instead of g g: so the noise of a pixel biases neither sum. All sums of a row are of integers, so their
// order does not matter.
#include "grey.h"
#include "method.h"
#include "pixels.h"

// lint: PIXEL_BYTES=1 ROW_GROUP=1 PIXELS=16
// lint: PIXEL_BYTES=2 ROW_GROUP=64 PIXELS=1

#ifndef ROW_GROUP
#error "ROW_GROUP: work-items that share a row"
#endif

#if PIXEL_BYTES == 1
#define load_wide(from) convert_ushort16(load_grey(from))
#define convert_pixels convert_uchar16
typedef ushort16 Wide;
typedef ushort Weight;
#define rounded_to_8_bit(value) (value)
#else
#define load_wide(from) convert_uint16(load_grey(from))
#define convert_pixels convert_ushort16
typedef uint16 Wide;
typedef uint Weight;
#define rounded_to_8_bit(value) (((value) + 128) >> 8)
#endif

#if PIXELS == 1
typedef long Longs;
#define LONGS_OF_INTS convert_long
#else
typedef long16 Longs;
#define LONGS_OF_INTS convert_long16
#endif

// Rows are resampled in 256ths of a pixel, columns read in 16ths.
#define ROW_STEPS 256
#define COLUMN_BITS 4
#define COLUMN_STEPS (1 << COLUMN_BITS)
#define COLUMNS 16
// Pixels of a work-item: lanes that share a row take neighbours, others as many blocks of COLUMNS as there are lanes.
#if PIXELS == 1
#define AT_ONCE 1
#else
#define AT_ONCE (PIXELS * COLUMNS)
#endif
#define PLACES_BITS 8
#define PLACES (1 << PLACES_BITS)  // from the middle of the image to its end

static inline float bounded(const float offset_px) {
  return clamp(offset_px, -EGOSGM_MAX_OFFSET_PX, EGOSGM_MAX_OFFSET_PX);
}

// Positions among `count` rows or columns, in `steps` from the middle to either end.
static inline Ints places(const Ints at, const int count, const int steps) {
  return INTS_OF_FLOATS(nearest(FLOATS_OF_INTS(2 * at + 1 - count) * ((float)steps / (float)count)));
}
#if PIXELS == 1
#define place places
#else
static inline int place(const int at, const int count, const int steps) { return places(at, count, steps).s0; }
#endif

// Copies the left image, and resamples the right one by the quadratic state[0] + state[1] u + state[2] v + state[3] u v
// + state[4] u^2 + state[5] v^2 pixels; u, v: -1 to 1 over the image. A work-group of ROW_GROUP a row and view.
COMPILED_ONCE void resample_row(const WorkItem at, const ImageSize size, global const float* state,
                                global const uchar* images, global uchar* aligned) {
  const int y = at.y;
  const int view = at.view;
  const float v = (float)place(y, size.height, PLACES) / PLACES;
  const float constant_term = (state[0] + state[2] * v) + state[5] * (v * v);
  const float linear_term = state[1] + state[3] * v;
  const float square_term = state[4];
  const size_t first = (size_t)view * size.height * size.width;
  global const Pixel* from = (global const Pixel*)images + first;
  global Pixel* to = (global Pixel*)aligned + first + (size_t)y * size.width;
  const Floats most = EGOSGM_MAX_OFFSET_PX;

  // One offset for COLUMNS columns: on KITTI it changes by less than a 20th of a pixel over them.
  for (int x = at.x * AT_ONCE; x < size.width; x += ROW_GROUP * AT_ONCE) {
    const Ints middle = (x / COLUMNS + LANE_INDICES) * COLUMNS + COLUMNS / 2;
    const Floats u = FLOATS_OF_INTS(places(middle, size.width, PLACES)) / PLACES;
    const Floats dy = constant_term + (linear_term + square_term * u) * u;
    const Floats bounded_dy = dy < -most ? -most : dy > most ? most : dy;
    const Ints moved = INTS_OF_FLOATS(nearest(bounded_dy * ROW_STEPS));
    const Ints offset = view == EGOSGM_RIGHT ? moved : (Ints)(0);
    const Ints weights = offset & (ROW_STEPS - 1);
    const Ints above = y + (offset >> 8), last_row = size.height - 1;
    const Ints uppers = min(max(above, (Ints)(0)), last_row) * size.width;
    const Ints lowers = min(max(above + 1, (Ints)(0)), last_row) * size.width;
    const int end = min(x + AT_ONCE, size.width);
    int blocks = 0;
#if PIXELS > 1
    blocks = (end - x) / COLUMNS;
    for (int block = 0; block < blocks; ++block) {
      const int column = x + block * COLUMNS;
      const Weight weight = LANE(int, weights, block);
      const Wide sum = load_wide(from + LANE(int, uppers, block) + column) * (Wide)(ROW_STEPS - weight) +
                       load_wide(from + LANE(int, lowers, block) + column) * (Wide)(weight);
      ((global PackedPixels*)(to + column))->pixels = convert_pixels((sum + (Wide)(ROW_STEPS / 2)) >> (Wide)(8));
    }
#endif
    for (int i = x + blocks * COLUMNS; i < end; ++i) {
      const uint upper = from[LANE(int, uppers, blocks) + i], lower = from[LANE(int, lowers, blocks) + i];
      const uint weight = LANE(int, weights, blocks);
      to[i] = (upper * (ROW_STEPS - weight) + lower * weight + ROW_STEPS / 2) >> 8;
    }
  }
}

KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void resample(const ImageSize size,
                                                                            global const float* state,
                                                                            global const uchar* images,
                                                                            global uchar* aligned) {
  resample_row(THIS_WORK_ITEM, size, state, images, aligned);
}

// Residuals and gradients are those of 8-bit grey values in 64ths: 4 by smoothing, 16 by interpolation.
#define GREY 64
#define MAX_RESIDUAL (EGOSGM_ALIGNED_MAX_RESIDUAL * GREY)
#define MIN_GRADIENT (EGOSGM_ALIGNED_MIN_GRADIENT * GREY)

// Sums of a row: g clamp(r) u^n for n = 0 to 2, of g_I g_J u^n for n = 0 to 4, and of 1; u: the column in the right
// image, -COARSE_PLACES to COARSE_PLACES, so that no sum is too large for 63 bits. A work-group of ROW_GROUP a sampled
// row.
#define COARSE_BITS 5
#define COARSE_PLACES (1 << COARSE_BITS)
#define GR_SUMS 3
#define GG_SUMS 5
#define COUNT (GR_SUMS + GG_SUMS)
#define SUMS (COUNT + 1)

// Every EGOSGM_ALIGNED_COLUMN_STRIDE-th value of a row from x on; where the row ends, its last one.
#if EGOSGM_ALIGNED_COLUMN_STRIDE != 2
#error "samples are the even lanes"
#endif
#define SAMPLE_INDICES (EGOSGM_ALIGNED_COLUMN_STRIDE * LANE_INDICES)
#if PIXELS == 1
static inline Floats sampled_disparities(global const float* row, const int x, const int width) { return row[x]; }
static inline Ints sampled_greys(global const Pixel* row, const int x, const int width) { return row[x]; }
#else
AT_EDGE Floats sampled_disparities_at_edge(global const float* row, const int x, const int width) {
  const Ints columns = min(x + SAMPLE_INDICES, (Ints)(width - 1));
  return gather(row, &columns);
}
AT_EDGE Ints sampled_greys_at_edge(global const Pixel* row, const int x, const int width) {
  const Ints columns = min(x + SAMPLE_INDICES, (Ints)(width - 1));
  return GATHERED(Ints, row, columns);
}
static inline Floats sampled_disparities(global const float* row, const int x, const int width) {
  if (x + 2 * PIXELS > width) return sampled_disparities_at_edge(row, x, width);
  return (Floats)(vload16(0, row + x).even, vload16(0, row + x + PIXELS).even);
}
static inline Ints sampled_greys(global const Pixel* row, const int x, const int width) {
  if (x + 2 * PIXELS > width) return sampled_greys_at_edge(row, x, width);
  return convert_int16((Pixels)(load_grey(row + x).even, load_grey(row + x + PIXELS).even));
}
#endif

// The grey values between columns u and u + 1, times COLUMN_STEPS.
static inline Ints between(global const Pixel* row, const Ints u, const Ints after) {
  return (COLUMN_STEPS - after) * GATHERED(Ints, row, u) + after * GATHERED(Ints, row + 1, u);
}

static inline long sum_of_lanes(const Longs lanes) {
#if PIXELS == 1
  return lanes;
#else
  const long8 halves = lanes.lo + lanes.hi;
  const long4 quarters = halves.lo + halves.hi;
  return quarters.x + quarters.y + quarters.z + quarters.w;
#endif
}

// Sums every ROW_GROUP-th sample of row y from that of `lane` on, or blocks of PIXELS samples.
COMPILED_ONCE void sum_row_residuals(const ImageSize size, const int y, const int lane, global const uchar* images,
                                     global const float* disparity, long row_sums[SUMS]) {
  Longs sums[SUMS];
  for (int n = 0; n < SUMS; ++n) sums[n] = 0;
  const int width = size.width;
  const size_t row = (size_t)y * width;
  global const Pixel* left = (global const Pixel*)images + row;
  global const Pixel* right = (global const Pixel*)images + (size_t)width * size.height + row;
  const Floats zero = 0.0f;
  const Floats last = COLUMN_STEPS * (width - 2);
  const Ints no = 0;
  const Ints most = MAX_RESIDUAL;
  const int step = EGOSGM_ALIGNED_COLUMN_STRIDE * PIXELS;
  for (int x = lane * step; x < width; x += ROW_GROUP * step) {
    const Ints column = x + SAMPLE_INDICES;
    const Floats d = sampled_disparities(disparity + row, x, width);
    const Floats at = (FLOATS_OF_INTS(column) - d) * COLUMN_STEPS;
    // Asked of the float, with comparisons that NaN fails, before it becomes an integer.
    const Ints inside = (column < width) & (d > INVALID) & (at >= zero) & (at <= last);
    const Ints position = INTS_OF_FLOATS(nearest(inside ? at : zero));
    const Ints u = position >> COLUMN_BITS;
    const Ints after = position & (COLUMN_STEPS - 1);

    const Ints i0 = sampled_greys(left - width, x, width), i1 = sampled_greys(left, x, width),
               i2 = sampled_greys(left + width, x, width);
    const Ints j0 = between(right - width, u, after), j1 = between(right, u, after),
               j2 = between(right + width, u, after);
    const Ints r = rounded_to_8_bit(COLUMN_STEPS * (i0 + 2 * i1 + i2) - (j0 + 2 * j1 + j2));
    const Ints g_left = rounded_to_8_bit(COLUMN_STEPS * (i2 - i0));
    const Ints g_right = rounded_to_8_bit(j2 - j0);
    const Ints g = g_left + g_right;
    const Ints is_textured = inside & (max(g, -g) >= MIN_GRADIENT);
    const Ints is_inlier = is_textured & (max(r, -r) < most);
    const Longs gr = LONGS_OF_INTS(is_textured ? g * min(max(r, -most), most) : no);
    const Longs gg = LONGS_OF_INTS(is_inlier ? 4 * g_left * g_right : no);  // each is half of what g is
    const Ints place_u = places(u, width, COARSE_PLACES);
    Ints power = 1;
#pragma unroll
    for (int n = 0; n < GG_SUMS; ++n, power *= place_u) {
      if (n < GR_SUMS) sums[n] += gr * LONGS_OF_INTS(power);
      sums[GR_SUMS + n] += gg * LONGS_OF_INTS(power);
    }
    sums[COUNT] += LONGS_OF_INTS(is_inlier & (Ints)(1));
  }
  for (int n = 0; n < SUMS; ++n) row_sums[n] = sum_of_lanes(sums[n]);
}

KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void sum_residuals(const ImageSize size,
                                                                                 global const uchar* images,
                                                                                 global const float* disparity,
                                                                                 global long* row_sums) {
  const int lane = get_local_id(0);
  const int sampled_row = get_global_id(1);
  const int y = EGOSGM_ALIGNED_BORDER_ROWS + sampled_row * EGOSGM_ALIGNED_ROW_STRIDE;
  long sums[SUMS] = {0};
  if (y + EGOSGM_ALIGNED_BORDER_ROWS < size.height) sum_row_residuals(size, y, lane, images, disparity, sums);
#if ROW_GROUP > 1
  local long totals[SUMS][ROW_GROUP];
  for (int n = 0; n < SUMS; ++n) totals[n][lane] = sums[n];
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = 1; lane == 0 && i < ROW_GROUP; ++i) {
    for (int n = 0; n < SUMS; ++n) sums[n] += totals[n][i];
  }
#endif
  if (lane == 0) {
    for (int n = 0; n < SUMS; ++n) row_sums[SUMS * sampled_row + n] = sums[n];
  }
}

#define TERMS EGOSGM_OFFSET_TERMS
#define MAX_ESTIMATES 1e6f  // counted no further

constant const int POWER_OF_U[TERMS] = {0, 1, 0, 1, 2, 0};
constant const int POWER_OF_V[TERMS] = {0, 0, 1, 1, 0, 2};

// Solves a system of equations by Cholesky's form without square roots: x is its right side and becomes its solution;
// of the symmetric matrix the lower half is given, and lost. Returns 0 where a pivot is not above `least`.
COMPILED_ONCE int solve(float matrix[TERMS][TERMS], float x[TERMS], const float least) {
  for (int i = 0; i < TERMS; ++i) {
    for (int j = 0; j < i; ++j) {
      const float factor = matrix[i][j] / matrix[j][j];
      for (int k = j + 1; k <= i; ++k) matrix[i][k] -= factor * matrix[k][j];
      x[i] -= factor * x[j];
    }
    if (!(matrix[i][i] > least)) return 0;
  }
  for (int i = TERMS - 1; i >= 0; --i) {
    for (int k = i + 1; k < TERMS; ++k) x[i] -= matrix[k][i] * x[k];
    x[i] /= matrix[i][i];
  }
  return 1;
}

// Which sums over the image a frame's step needs: of u^n v^m times g clamp(r), n + m up to GR_SUMS - 1, and times g_I
// g_J, n + m up to GG_SUMS - 1; as squares [n][m], the former first.
#define GR_MOMENTS (GR_SUMS * GR_SUMS)
#define MOMENTS (GR_MOMENTS + GG_SUMS * GG_SUMS)

// A row's sum times v^m takes more than 63 bits together with the others, so that what lies above its lowest LOW_BITS
// is summed apart. An image of up to 16384 x 16384 pixels has 2^13 samples in each of 2^12 rows: of |g_I g_J u^n| <=
// 2^(26 + 5 n) a row's sum has 39 + 5 n bits, and v^m in PLACES 8 m; v^4 is on average less than a quarter of its most.
// So both parts stay below 2^62.
#define LOW_BITS 19

// A sum over the image of u^n v^m, from the rows' sums number `sum`, which hold u^n. The sums are of integers, and the
// rest is exact but for two conversions and a sum, so that no compiler can make another number of it.
COMPILED_ONCE float moment_of(const int height, const int rows, const int n, const int m, const int sum,
                              global const long* row_sums) {
  long high = 0, low = 0;
  for (int row = 0; row < rows; ++row) {
    const long v = place(EGOSGM_ALIGNED_BORDER_ROWS + row * EGOSGM_ALIGNED_ROW_STRIDE, height, PLACES);
    long power = 1;
    for (int i = 0; i < m; ++i) power *= v;
    const long u_sum = row_sums[SUMS * row + sum];
    high += (u_sum >> LOW_BITS) * power;
    low += (u_sum & ((1 << LOW_BITS) - 1)) * power;
  }
  return ldexp((float)high * (1 << LOW_BITS) + (float)low, -(COARSE_BITS * n + PLACES_BITS * m));
}

// The step of a frame, by the running mean of the frames so far at first and then at a fixed gain. state: the terms of
// the offset [px], and the number of estimates that they rest on. A single work-group of ROW_GROUP, whose work-items
// share the sums; `state` and `next` may be the same.
KERNEL __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void update_terms(
    const ImageSize size, const int sampled_rows, const float gain, global const long* row_sums,
    global const float* state, global float* next) {
  local float moments[MOMENTS];
  for (int i = get_local_id(0); i < MOMENTS; i += ROW_GROUP) {
    const int is_gr = i < GR_MOMENTS, side = is_gr ? GR_SUMS : GG_SUMS;
    const int n = (is_gr ? i : i - GR_MOMENTS) / side, m = (is_gr ? i : i - GR_MOMENTS) % side;
    if (n + m < side) {
      moments[i] = moment_of(size.height, sampled_rows, n, m, is_gr ? n : GR_SUMS + n, row_sums);
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (get_local_id(0) == 0) {
    local const float* gr = moments;
    local const float* gg = moments + GR_MOMENTS;
    float matrix[TERMS][TERMS];
    float step[TERMS];
    long count = 0;
    for (int row = 0; row < sampled_rows; ++row) count += row_sums[SUMS * row + COUNT];
    for (int i = 0; i < TERMS; ++i) {
      step[i] = gr[GR_SUMS * POWER_OF_U[i] + POWER_OF_V[i]];
      for (int j = 0; j <= i; ++j) {
        matrix[i][j] = gg[GG_SUMS * (POWER_OF_U[i] + POWER_OF_U[j]) + POWER_OF_V[i] + POWER_OF_V[j]];
      }
    }
    const float all = matrix[0][0];
    const float mean_step = step[0] / all;
    for (int i = 1; i < TERMS; ++i) {
      matrix[i][i] += EGOSGM_OFFSET_PRIOR * all;
      step[i] -= EGOSGM_OFFSET_PRIOR * all * state[i];
    }
    const int enough = (count >= EGOSGM_ALIGNED_MIN_SAMPLES) & (all > 0.0f);
    const int has_terms = enough && solve(matrix, step, 0.5f * EGOSGM_OFFSET_PRIOR * all);
    const float estimates = state[TERMS];
    const float share = fmax(gain, 1.0f / fmax(estimates, 1.0f));
    for (int i = 0; i < TERMS; ++i) {
      const float change = has_terms ? step[i] : enough && i == 0 ? mean_step : 0.0f;
      next[i] = bounded(state[i] + share * clamp(change, -EGOSGM_MAX_OFFSET_STEP_PX, EGOSGM_MAX_OFFSET_STEP_PX));
    }
    next[TERMS] = enough ? fmin(estimates + 1.0f, MAX_ESTIMATES) : estimates;
  }
}
