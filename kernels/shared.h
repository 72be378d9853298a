// SPDX-License-Identifier: Apache-2.0
// What the host and the kernels must agree on, in the C that both compile.
#ifndef EGOSGM_KERNELS_SHARED_H
#define EGOSGM_KERNELS_SHARED_H

#ifdef __cplusplus
#include <CL/cl_platform.h>
namespace egosgm::shared {
typedef cl_int int32;
typedef cl_short int16;
typedef cl_ushort uint16;
typedef cl_uint uint32;
typedef cl_float float32;
#else
typedef int int32;
typedef short int16;
typedef ushort uint16;
typedef uint uint32;
typedef float float32;
#endif

// A pixel without a disparity; include/egosgm/image.h says the same to users.
#define EGOSGM_INVALID_DISPARITY (-32768.0f)

// Maps and images of a stereo pair lie in one buffer, the left view first: index view * width * height + y * width + x.
#define EGOSGM_LEFT 0
#define EGOSGM_RIGHT 1

// Disparities are matched in chunks of this many lanes.
#define EGOSGM_LANES 16
// The first lane of a band is min_disparity plus a multiple of this.
#define EGOSGM_BAND_STEP 4

// Predictions are summed up over blocks of this many pixels a side, for the bands of pixels without one.
#define EGOSGM_BLOCK 8

typedef struct {
  int32 width, height;
} ImageSize;

// Disparities [min, min + count).
typedef struct {
  int32 min, count;
} DisparityRange;

// What a pixel searches. Lanes origin .. origin + chunks * EGOSGM_LANES - 1 are computed; first .. last (inclusive) can
// win.
typedef struct {
  int16 origin;
  uint16 chunks;
  int16 first, last;
} Band;

// What a row of a view searches: cells that can win, lanes that are computed, pixels that were predicted.
typedef struct {
  uint32 searched, computed, predicted;
} RowSum;

// The predictions in a block of EGOSGM_BLOCK x EGOSGM_BLOCK pixels; count 0: none.
typedef struct {
  float32 min, max;
  uint32 count;
} BlockRange;

// What a sweep of BandedSgm needs to know.
typedef struct {
  int32 width, height;
  int32 min_disparity, disparities;
  int32 padding;  // of the census codes' rows
  int32 p1, p2, s_max;
  float32 variance_floor, variance_per_step;
} SgmParameters;

// How a view's disparity space moves (eqs. 1-4): rows 1, 2 and 4 of H = Gamma T Gamma^-1; row 3 is (0, 0, 1, 0).
// noise: variance of the depth's error Z' as a form in (1, X', Y'), from the motion's covariance (see forward_warp.cl).
typedef struct {
  float32 x[4], y[4], w[4];
  float32 cx, cy, doffs;
  float32 fx, fy, fx_baseline;
  float32 noise_1, noise_x, noise_y, noise_xx, noise_xy, noise_yy;
} DisparityMotion;

#ifdef __cplusplus
static_assert(sizeof(ImageSize) == 8 && sizeof(DisparityRange) == 8 && sizeof(Band) == 8 && sizeof(RowSum) == 12 &&
                  sizeof(BlockRange) == 12 && sizeof(SgmParameters) == 40 && sizeof(DisparityMotion) == 96,
              "kernels/*.cl read these layouts");
}  // namespace egosgm::shared
#endif

#endif
