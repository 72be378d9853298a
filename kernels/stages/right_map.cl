// SPDX-License-Identifier: Apache-2.0
// The right view's map by the left one's. Where the right view was measured, it has what the left pixel has that it
// sees, or the measurement if that contradicts it. Elsewhere it has the nearest of the left surfaces that land
// there: the left pixel x lands on the right pixel nearest to x - d.
//
// Several may land on one pixel. Each bids a key, of which the largest wins, so the result does not depend on the order
// in which they come: d in steps of 2^-16 px, counted from one pixel below the range, so that 0 is nobody's. GPUs, a
// pixel a work-item: atomic maxima. CPUs, where atomics are slow: a work-item owns a row.
#include "method.h"
#include "pixels.h"

// lint: PIXELS=1
// lint: PIXELS=16

// Rows of keys are whole blocks, with a place behind the image for what lands nowhere.
static inline size_t key_row(const int y, const int width) { return (size_t)y * ((width / PIXELS + 1) * PIXELS); }

static inline Ints load_keys(global const int* keys) {
#if PIXELS == 1
  return *keys;
#else
  return vload16(0, keys);
#endif
}

typedef struct {
  Ints keys, targets;  // where it lands nowhere 0 and `width`
} Bids;

static inline Bids bids_of(const int width, const int min_disparity, const int x, const Floats d) {
  const Floats zero = 0.0f;
  const Floats least = 1.0f;
  const Floats most = 2147483520.0f;  // the largest below 2^31
  // Asked of the floats, with comparisons that NaN fails, before they become integers.
  const Floats at = nearest(FLOATS_OF_INTS(x + LANE_INDICES) - d);
  const Ints lands = (d > INVALID) & (at >= zero) & (at < (Floats)(width));
  const Floats steps = (d - (float)min_disparity + 1.0f) * EGOSGM_RIGHT_MAP_STEPS_PER_PX;
  const Floats above = steps > least ? steps : least;
  Bids bids;
  bids.keys = lands ? INTS_OF_FLOATS(above < most ? above : most) : (Ints)(0);
  bids.targets = INTS_OF_FLOATS(lands ? at : (Floats)(width));
  return bids;
}

// REQUIRES: on GPUs, keys of 0.
COMPILED_ONCE void splat_row(const WorkItem at, const ImageSize size, const int row_step, const int min_disparity,
                             global const float* disparity, global int* keys) {
  if (!has_row(at, row_step)) return;
  const int y = at.y;
  const int width = size.width;
  const size_t row = (size_t)y * width;
  global int* bids = keys + key_row(y, width);
#if PIXELS > 1
  for (int x = 0; x <= width; x += PIXELS) ((global PackedInts*)(bids + x))->lanes = 0;
#endif

  FOR_CHUNKS(start, width) {
    Ints keys_of[CHUNK], targets[CHUNK];
    FOR_BLOCKS(x, i, start, width) {
      const Bids own = bids_of(width, min_disparity, x, load_pixels(disparity + row, x, width));
      // A bid from two pixels or more to the left is smaller than one from beside: written from left to right, the bid
      // that comes last is the nearest.
      const Bids left = bids_of(width, min_disparity, x - 1, load_pixels(disparity + row, x - 1, width));
      keys_of[i] = own.targets == left.targets ? max(own.keys, left.keys) : own.keys;
      targets[i] = own.targets;
    }
    FOR_BLOCKS(x, i, start, width) {
#if PIXELS == 1
      if (keys_of[i] != 0) atomic_max(&bids[targets[i]], keys_of[i]);
#else
#pragma unroll
      for (int lane = 0; lane < PIXELS; ++lane) {
        bids[LANE(int, targets[i], lane)] = LANE(int, keys_of[i], lane);
      }
#endif
    }
  }
}

KERNEL void splat(const ImageSize size, const int row_step, const int min_disparity, global const float* disparity,
                  global int* keys) {
  splat_row(THIS_WORK_ITEM, size, row_step, min_disparity, disparity, keys);
}

// makes_variance: else disparities only.
COMPILED_ONCE void decode_row(const WorkItem at, const ImageSize size, const int row_step, const int min_disparity,
                              const float max_difference, const int makes_variance, global const int* keys,
                              global const float* measured, global const float* measured_variance,
                              global float* disparity, global float* variance) {
  if (!has_row(at, row_step)) return;
  const int y = at.y;
  const int width = size.width;
  const size_t row = (size_t)y * width;
  const size_t right_row = ((size_t)EGOSGM_RIGHT * size.height + y) * width;
  global const int* bids = keys + key_row(y, width);

  FOR_CHUNKS(start, width) {
    Floats values[CHUNK];
    Ints sees[CHUNK], lefts[CHUNK];
    FOR_BLOCKS(x, i, start, width) {
      const Floats zero = 0.0f;
      const Floats z = load_pixels(measured + right_row, x, width);
      const Ints key = load_keys(bids + x);
      const Floats landed = FLOATS_OF_INTS(key) * (1.0f / EGOSGM_RIGHT_MAP_STEPS_PER_PX) - 1.0f + (float)min_disparity;
      const Floats d = z > INVALID ? z : landed;
      const Floats at = nearest(FLOATS_OF_INTS(x + LANE_INDICES) + d);
      const Ints inside = ((z > INVALID) | (key != 0)) & (at >= zero) & (at < (Floats)(width));
      values[i] = d;
      sees[i] = inside;
      lefts[i] = INTS_OF_FLOATS(inside ? at : zero);
    }
    FOR_BLOCKS(x, i, start, width) {
      const Floats z = load_pixels(measured + right_row, x, width);
      const Floats seen = gather(disparity + row, &lefts[i]);
      const Ints agrees = sees[i] & (seen > INVALID) & (fabs(seen - values[i]) <= max_difference);
      store_pixels(agrees ? seen : z > INVALID ? z : INVALID, disparity + right_row, x, width);
      if (!makes_variance) continue;
      const Floats p = gather(variance + row, &lefts[i]);
      const Floats r = load_pixels(measured_variance + right_row, x, width);
      store_pixels(agrees ? p : r, variance + right_row, x, width);
    }
  }
}

KERNEL void decode(const ImageSize size, const int row_step, const int min_disparity, const float max_difference,
                   const int makes_variance, global const int* keys, global const float* measured,
                   global const float* measured_variance, global float* disparity, global float* variance) {
  decode_row(THIS_WORK_ITEM, size, row_step, min_disparity, max_difference, makes_variance, keys, measured,
             measured_variance, disparity, variance);
}
