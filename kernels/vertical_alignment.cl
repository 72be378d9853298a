// SPDX-License-Identifier: Apache-2.0
// The vertical offset dy between the rows of the views: I(x, y) = J(x - d, y + dy), left image I, right image J.
//
// With the right image resampled by the offset known so far, what is left of it minimises the sum of Huber's function
// of r = I(x, y) - J(x - d, y + step) over the pixels; a Newton step is sum(g clamp(r)) / sum(g_I g_J), the latter
// where r is not clamped, with g the mean of the vertical gradients g_I and g_J (after Lucas and Kanade 1981). Smoothed
// rows for r, g of both images, and the product of the two gradients instead of g g: so the noise of a pixel biases
// neither sum. All sums are of integers, so their order does not matter.
#include "grey.h"

// lint: PIXEL_BYTES=1 ROW_GROUP=1
// lint: PIXEL_BYTES=2 ROW_GROUP=64

#ifndef ROW_GROUP
#error "ROW_GROUP: work-items that share a row"
#endif

#if PIXEL_BYTES == 1
#define vload_pixels(offset, from) convert_ushort16(vload16(offset, from))
#define convert_pixels convert_uchar16
typedef ushort16 Wide;
typedef ushort Weight;
#define rounded_to_8_bit(value) (value)
#else
#define vload_pixels(offset, from) convert_uint16(vload16(offset, from))
#define convert_pixels convert_ushort16
typedef uint16 Wide;
typedef uint Weight;
#define rounded_to_8_bit(value) (((value) + 128) >> 8)
#endif

// Rows are resampled in 256ths of a pixel, columns read in 16ths.
#define ROW_STEPS 256
#define COLUMN_STEPS 16

inline int clamp_row(const int y, const int height) { return clamp(y, 0, height - 1); }

// Copies the left image, and resamples the right one by state[0] pixels. A work-group of ROW_GROUP a row and view.
kernel __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void resample(const ImageSize size,
                                                                            global const float* state,
                                                                            global const uchar* images,
                                                                            global uchar* aligned) {
  const int lane = get_local_id(0);
  const int y = get_global_id(1);
  const int view = get_global_id(2);
  const int offset = view == EGOSGM_RIGHT ? convert_int_rte(state[0] * ROW_STEPS) : 0;
  const int above = y + (offset >> 8);
  const Weight weight = offset & (ROW_STEPS - 1);
  const size_t first = (size_t)view * size.height * size.width;
  global const Pixel* upper = (global const Pixel*)images + first + (size_t)clamp_row(above, size.height) * size.width;
  global const Pixel* lower =
      (global const Pixel*)images + first + (size_t)clamp_row(above + 1, size.height) * size.width;
  global Pixel* to = (global Pixel*)aligned + first + (size_t)y * size.width;

  const int whole = size.width & ~15;
  for (int x = lane * 16; x < whole; x += ROW_GROUP * 16) {
    const Wide sum =
        vload_pixels(0, upper + x) * (Wide)(ROW_STEPS - weight) + vload_pixels(0, lower + x) * (Wide)(weight);
    vstore16(convert_pixels((sum + (Wide)(ROW_STEPS / 2)) >> (Wide)(8)), 0, to + x);
  }
  for (int x = whole + lane; x < size.width; x += ROW_GROUP) {
    to[x] = ((uint)upper[x] * (ROW_STEPS - weight) + (uint)lower[x] * weight + ROW_STEPS / 2) >> 8;
  }
}

// Rows and columns that are sampled: every fourth row and second column. Nearer to the upper and lower border than
// this, the resampled image may repeat a row.
#define FIRST_ROW 4
#define ROW_STRIDE 4
#define COLUMN_STRIDE 2

// Residuals and gradients are those of 8-bit grey values in 64ths: 4 by smoothing, 16 by interpolation.
#define GREY 64
#define MAX_RESIDUAL (12 * GREY)  // beyond, it is rather a wrong match or an occlusion than an offset
#define MIN_GRADIENT (2 * GREY)   // below, it is noise

// Sums of g clamp(r), g_I g_J and 1 over a row. A work-group of ROW_GROUP a sampled row.
kernel __attribute__((reqd_work_group_size(ROW_GROUP, 1, 1))) void sum_rows(const ImageSize size,
                                                                            global const uchar* images,
                                                                            global const float* disparity,
                                                                            global long* row_sums) {
  const int lane = get_local_id(0);
  const int sampled_row = get_global_id(1);
  const int y = FIRST_ROW + sampled_row * ROW_STRIDE;
  const size_t width = size.width;
  const float last = (float)(COLUMN_STEPS * (size.width - 2));
  long gr = 0;
  long gg = 0;
  int count = 0;
  if (y + FIRST_ROW < size.height) {
    const size_t row = (size_t)y * width;
    global const Pixel* left = (global const Pixel*)images + row;
    global const Pixel* right = (global const Pixel*)images + width * size.height + row;
    for (int x = lane * COLUMN_STRIDE; x < size.width; x += ROW_GROUP * COLUMN_STRIDE) {
      const float d = disparity[row + x];
      const float at = ((float)x - d) * COLUMN_STEPS;
      // Asked of the float, with comparisons that NaN fails, before it becomes an integer.
      const int inside = (d > EGOSGM_INVALID_DISPARITY) & (at >= 0.0f) & (at <= last);
      if (!inside) continue;
      const uint position = convert_uint_rte(at);
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
      gr += is_textured ? g * clamp(r, -MAX_RESIDUAL, MAX_RESIDUAL) : 0;
      gg += is_inlier ? 4 * g_left * g_right : 0;  // each is half of what g is
      count += is_inlier;
    }
  }
#if ROW_GROUP > 1
  local long totals[3][ROW_GROUP];
  totals[0][lane] = gr;
  totals[1][lane] = gg;
  totals[2][lane] = count;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = 1; lane == 0 && i < ROW_GROUP; ++i) {
    gr += totals[0][i];
    gg += totals[1][i];
    count += totals[2][i];
  }
#endif
  if (lane == 0) {
    row_sums[3 * sampled_row] = gr;
    row_sums[3 * sampled_row + 1] = gg;
    row_sums[3 * sampled_row + 2] = count;
  }
}

#define MIN_SAMPLES 256     // fewer tell nothing
#define MAX_STEP 1.0f       // of a frame [px]: beyond, the linearisation does not hold
#define MAX_OFFSET 2.0f     // [px]
#define MAX_ESTIMATES 1e6f  // counted no further

// The step of a frame, by the running mean of the frames so far at first and then at a fixed gain. state: offset [px],
// and the number of estimates that it rests on. A single work-item; `state` and `next` may be the same.
kernel void update(const int sampled_rows, const float gain, global const long* row_sums, global const float* state,
                   global float* next) {
  if (get_global_id(0) > 0) return;
  long gr = 0;
  long gg = 0;
  long count = 0;
  for (int row = 0; row < sampled_rows; ++row) {
    gr += row_sums[3 * row];
    gg += row_sums[3 * row + 1];
    count += row_sums[3 * row + 2];
  }
  const float offset = state[0];
  const float estimates = state[1];
  const int enough = (count >= MIN_SAMPLES) & (gg > 0);
  const float step = enough ? clamp((float)gr / (float)gg, -MAX_STEP, MAX_STEP) : 0.0f;
  const float share = fmax(gain, 1.0f / fmax(estimates, 1.0f));
  next[0] = clamp(offset + share * step, -MAX_OFFSET, MAX_OFFSET);
  next[1] = enough ? fmin(estimates + 1.0f, MAX_ESTIMATES) : estimates;
}
