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

// lint: PIXEL_BYTES=1 ROW_GROUP=1
// lint: PIXEL_BYTES=2 ROW_GROUP=64

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

// As `nearest` has it of blocks of pixels.
static inline float nearest_whole(const float value) {
  const float shift = 12582912.0f;  // 1.5 * 2^23
  return (value + shift) - shift;
}

// Rows are resampled in 256ths of a pixel, columns read in 16ths.
#define ROW_STEPS 256
#define COLUMN_STEPS 16
#define COLUMNS 16
// Pixels of a work-item: lanes that share a row take neighbours.
#if ROW_GROUP == 1
#define AT_ONCE COLUMNS
#else
#define AT_ONCE 1
#endif
#define PLACES_BITS 8
#define PLACES (1 << PLACES_BITS)  // from the middle of the image to its end

inline float bounded(const float offset_px) { return clamp(offset_px, -EGOSGM_MAX_OFFSET_PX, EGOSGM_MAX_OFFSET_PX); }

inline int clamp_row(const int y, const int height) { return clamp(y, 0, height - 1); }

// Where among `count` rows or columns, in `steps` from the middle to either end.
inline int place(const int at, const int count, const int steps) {
  return (int)nearest_whole((float)(2 * at + 1 - count) * ((float)steps / (float)count));
}

// Copies the left image, and resamples the right one by the quadratic state[0] + state[1] u + state[2] v + state[3] u v
// + state[4] u^2 + state[5] v^2 pixels; u, v: -1 to 1 over the image. A work-group of ROW_GROUP a row and view.
COMPILED_ONCE void resample_row(const WorkItem at, const ImageSize size, global const float* state,
                                global const uchar* images, global uchar* aligned) {
  const int y = at.y;
  const int view = at.view;
  const int is_moved = view == EGOSGM_RIGHT;
  const float v = (float)place(y, size.height, PLACES) / PLACES;
  const float constant_term = (state[0] + state[2] * v) + state[5] * (v * v);
  const float linear_term = state[1] + state[3] * v;
  const float square_term = state[4];
  const size_t first = (size_t)view * size.height * size.width;
  global const Pixel* from = (global const Pixel*)images + first;
  global Pixel* to = (global Pixel*)aligned + first + (size_t)y * size.width;

  // One offset for COLUMNS columns: on KITTI it changes by less than a 20th of a pixel over them.
  for (int x = at.x * AT_ONCE; x < size.width; x += ROW_GROUP * AT_ONCE) {
    const float u = (float)place(x / COLUMNS * COLUMNS + COLUMNS / 2, size.width, PLACES) / PLACES;
    const float dy = bounded(constant_term + (linear_term + square_term * u) * u);
    const int offset = is_moved ? (int)nearest_whole(dy * ROW_STEPS) : 0;
    const int above = y + (offset >> 8);
    const Weight weight = offset & (ROW_STEPS - 1);
    global const Pixel* upper = from + (size_t)clamp_row(above, size.height) * size.width;
    global const Pixel* lower = from + (size_t)clamp_row(above + 1, size.height) * size.width;
#if AT_ONCE > 1
    if (x + COLUMNS <= size.width) {
      Pixels pixels = load_grey(upper + x);
      if (weight != 0) {
        const Wide sum = load_wide(upper + x) * (Wide)(ROW_STEPS - weight) + load_wide(lower + x) * (Wide)(weight);
        pixels = convert_pixels((sum + (Wide)(ROW_STEPS / 2)) >> (Wide)(8));
      }
      ((global PackedPixels*)(to + x))->pixels = pixels;
      continue;
    }
#endif
    for (int i = x; i < min(x + AT_ONCE, size.width); ++i) {
      to[i] = ((uint)upper[i] * (ROW_STEPS - weight) + (uint)lower[i] * weight + ROW_STEPS / 2) >> 8;
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

// Of a row: sums of g clamp(r) u^n for n = 0 to 2, of g_I g_J u^n for n = 0 to 4, and of 1; u: the column in the right
// image, -COARSE_PLACES to COARSE_PLACES, so that no sum is too large for 63 bits. A work-group of ROW_GROUP a sampled
// row.
#define COARSE_BITS 5
#define COARSE_PLACES (1 << COARSE_BITS)
#define GR_SUMS 3
#define GG_SUMS 5
#define COUNT (GR_SUMS + GG_SUMS)
#define SUMS (COUNT + 1)

// Adds to them what the pixels at a place have together.
static inline void add_at(const int place_u, long gr, long gg, long sums[SUMS]) {
  for (int n = 0; n < GR_SUMS; ++n, gr *= place_u) sums[n] += gr;
  for (int n = 0; n < GG_SUMS; ++n, gg *= place_u) sums[GR_SUMS + n] += gg;
}

// What every ROW_GROUP-th sample of row y from that of `lane` on gives.
COMPILED_ONCE void sum_row_residuals(const ImageSize size, const int y, const int lane, global const uchar* images,
                                     global const float* disparity, long row_sums[SUMS]) {
  long sums[SUMS] = {0};
  long gr_here = 0, gg_here = 0;  // of the last pixels, which have one place
  int here = 0;
  const size_t width = size.width;
  const float last = (float)(COLUMN_STEPS * (size.width - 2));
  const size_t row = (size_t)y * width;
  global const Pixel* left = (global const Pixel*)images + row;
  global const Pixel* right = (global const Pixel*)images + width * size.height + row;
  for (int x = lane * EGOSGM_ALIGNED_COLUMN_STRIDE; x < size.width; x += ROW_GROUP * EGOSGM_ALIGNED_COLUMN_STRIDE) {
    const float d = disparity[row + x];
    const float at = ((float)x - d) * COLUMN_STEPS;
    // Asked of the float, with comparisons that NaN fails, before it becomes an integer.
    const int inside = (d > EGOSGM_INVALID_DISPARITY) & (at >= 0.0f) & (at <= last);
    if (!inside) continue;
    const uint position = (uint)nearest_whole(at);
    const size_t u = position / COLUMN_STEPS;
    const int after = position % COLUMN_STEPS;
    const int before = COLUMN_STEPS - after;

    const int i0 = left[x - width], i1 = left[x], i2 = left[x + width];
    const int j0 = before * right[u - width] + after * right[u + 1 - width];
    const int j1 = before * right[u] + after * right[u + 1];
    const int j2 = before * right[u + width] + after * right[u + 1 + width];
    const int r = rounded_to_8_bit(COLUMN_STEPS * (i0 + 2 * i1 + i2) - (j0 + 2 * j1 + j2));
    const int g_left = rounded_to_8_bit(COLUMN_STEPS * (i2 - i0));
    const int g_right = rounded_to_8_bit(j2 - j0);
    const int g = g_left + g_right;
    const int is_textured = abs(g) >= MIN_GRADIENT;
    const int is_inlier = is_textured & (abs(r) < MAX_RESIDUAL);
    const int place_u = place((int)u, size.width, COARSE_PLACES);
    if (place_u != here) {
      add_at(here, gr_here, gg_here, sums);
      gr_here = 0;
      gg_here = 0;
      here = place_u;
    }
    gr_here += is_textured ? g * clamp(r, -MAX_RESIDUAL, MAX_RESIDUAL) : 0;
    gg_here += is_inlier ? 4 * g_left * g_right : 0;  // each is half of what g is
    sums[COUNT] += is_inlier;
  }
  add_at(here, gr_here, gg_here, sums);
  for (int n = 0; n < SUMS; ++n) row_sums[n] = sums[n];
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
