// SPDX-License-Identifier: Apache-2.0
// What the host and the kernels must agree on, in the C that both compile.
#ifndef EGOSGM_KERNELS_SHARED_H
#define EGOSGM_KERNELS_SHARED_H

#ifdef __cplusplus
#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 120
#endif
#include <CL/cl_platform.h>
namespace egosgm::shared {
typedef cl_int i32;
typedef cl_short i16;
typedef cl_ushort u16;
typedef cl_uint u32;
typedef cl_float f32;
#else
typedef int i32;
typedef short i16;
typedef ushort u16;
typedef uint u32;
typedef float f32;

// Before every kernel. Where a work-item's values are vectors, a compiler that makes vectors of work-items too (Intel's
// for CPUs) takes minutes, and has given other sums than were written.
#if defined(PIXELS) && PIXELS == 1
#define KERNEL kernel
#else
#define KERNEL kernel __attribute__((vec_type_hint(int16)))
#endif
#endif

// A pixel without a disparity; include/egosgm/image.h says the same to users.
#define EGOSGM_INVALID_DISPARITY (-32768.0f)

// Maps and images of a stereo pair lie in one buffer, the left view first: index view * width * height + y * width + x.
#define EGOSGM_LEFT 0
#define EGOSGM_RIGHT 1

// Disparities are matched in chunks of this many lanes: one, or an even number of them.
#define EGOSGM_LANES 8
// The first lane of a band with more than one chunk is min_disparity plus a multiple of this.
#define EGOSGM_BAND_STEP 4

// Predictions are summed up over blocks of this many pixels a side, for the bands of pixels without one.
#define EGOSGM_BLOCK 8

// In place of a wave of tiles: BandedSgm's work-items take a view each, with all of its tiles.
#define EGOSGM_ALL_TILES (-1)

// CoarseMatch takes this many pixels a side for one.
#define EGOSGM_COARSE 4
// SearchBand looks at a block's coarse pixels and the ones around them, and believes this many that have a disparity.
#define EGOSGM_COARSE_MIN_COUNT 8
// Of these, so many of the least and of the largest are taken for mismatches. REQUIRES: less than half of the count.
#define EGOSGM_COARSE_OUTLIERS 2

// SearchBand calls a ridge what lies nearer than something at most this many pixels to its left, and to its right: a
// pole. CoarseMatch's maps are looked through too, that many of their pixels far.
#define EGOSGM_RIDGE_REACH 6
#define EGOSGM_COARSE_RIDGE_REACH 2
// Of a warped map's block, at least so many pixels must be ridges. They are searched for in their own block and in this
// many above and below.
#define EGOSGM_RIDGE_MIN_COUNT 2
#define EGOSGM_RIDGE_BLOCKS 6

// The matching variance where the path sums fall on beyond the end of a band: the true disparity rather lies outside.
// KalmanUpdate then takes the measurement instead of fusing it, as where the two differ by more than the gate, and the
// next frame searches wide around it.
#define EGOSGM_ESCAPED_VARIANCE_PX2 16.0f

// VerticalAlignment's quadratic: 1, u, v, u v, u^2, v^2.
#define EGOSGM_OFFSET_TERMS 6

// OutputVariance: the filter's and the measurement's variance, each cut, at every fourth pixel around; the sum of two
// second differences of disparities, each cut, at every pixel nearer by; and how far the disparities this far off to
// eight sides are from a pixel's own, each cut.
#define EGOSGM_VARIANCE_RADIUS 8
#define EGOSGM_VARIANCE_STEP 4
#define EGOSGM_MAX_MEAN_VARIANCE_PX2 2.0f
#define EGOSGM_ROUGHNESS_RADIUS 3
#define EGOSGM_MAX_ROUGHNESS_PX 1.5f
#define EGOSGM_JUMP_DISTANCE 2
#define EGOSGM_MAX_JUMP_PX 10.0f

// KalmanUpdate asks every fourth pixel this far to all sides: 25. Near is what differs by less than this.
#define EGOSGM_SUPPORT_RADIUS 8
#define EGOSGM_SUPPORT_STEP 4
#define EGOSGM_SUPPORT_PX 2.0f
// A measurement that at least so many of them have too stands against a prediction, or against none that vouches.
#define EGOSGM_SUPPORT_HALF 13
#define EGOSGM_SUPPORT_MOST 18
// What is measured further off than this moves by itself, where so many of them are off to the same side by the latter.
#define EGOSGM_MOVING_PX 1.0f
#define EGOSGM_MOVING_AROUND_PX 0.75f
#define EGOSGM_MOVING_COUNT 15

// PredictionCheck looks at every so many rows of the left view. Prediction and measurement differ where they do by more
// than this.
#define EGOSGM_CHECKED_ROWS 4
#define EGOSGM_CHECKED_DIFFERENCE_PX 1.0f

// DynamicMap looks this many pixels to all sides, and believes this many of the window that have a prediction and a
// measurement: a third of it.
#define EGOSGM_DYNAMIC_RADIUS 4
#define EGOSGM_DYNAMIC_MIN_COUNT 27

// The disparities of RightMap are whole numbers of such steps.
#define EGOSGM_RIGHT_MAP_STEPS_PER_PX 65536.0f

// The variance of a hole that MedianFilter fills.
#define EGOSGM_FILLED_VARIANCE_PX2 1.0f

// The 32 pixels dx, dy of a 13x11 window that MatchingCost::kCensus13x11 compares with its centre: on a golden-angle
// spiral, as dense as a normal distribution of deviations 3.4 and 2.6 px, each moved to the nearest free pixel.
#define EGOSGM_CENSUS13X11_RADIUS_X 6
#define EGOSGM_CENSUS13X11_RADIUS_Y 5
#define EGOSGM_CENSUS13X11                                                                                             \
  {                                                                                                                    \
    {1, 0}, {-1, 1}, {0, -1}, {1, 1}, {-2, 0}, {2, -1}, {-1, 2}, {-1, -2}, {3, 1}, {-3, 1}, {1, -2}, {1, 2}, {-3, -1}, \
        {3, -1}, {-2, 2}, {-1, -3}, {3, 2}, {-4, 0}, {3, -2}, {0, 4}, {-3, -3}, {5, 1}, {-4, 2}, {1, -4}, {3, 4},      \
        {-6, -1}, {6, -2}, {-3, 5}, {-2, -5}, {6, 3}, {-6, 2}, {                                                       \
      5, -5                                                                                                            \
    }                                                                                                                  \
  }

typedef struct {
  i32 width, height;
} ImageSize;

// Disparities [min, min + count).
typedef struct {
  i32 min, count;
} DisparityRange;

// What a pixel searches. Lanes origin .. origin + chunks * EGOSGM_LANES - 1 are computed; first .. last (inclusive) can
// win.
typedef struct {
  i16 origin;
  u16 chunks;
  i16 first, last;
} Band;

#ifndef __cplusplus
// By one load of eight bytes, which compilers do not make of four members of two.
inline Band band_at(global const Band* bands, const size_t at) {
  const short4 members = ((global const short4*)bands)[at];
  const Band band = {members.x, (ushort)members.y, members.z, members.w};
  return band;
}
#endif

// What a row of a view searches: cells, which are lanes of its bands, also those that cannot win; predicted pixels.
typedef struct {
  u32 cells, predicted;
} RowSum;

// The predictions in a block of EGOSGM_BLOCK x EGOSGM_BLOCK pixels; count 0: none.
typedef struct {
  f32 min, max;
  u32 count;
} BlockRange;

// Of the pixels that PredictionCheck looks at: those with a prediction, those that have a measurement too, and those
// among them where the two differ.
typedef struct {
  u32 predicted, both, differing;
} PredictionCounts;

// What PredictionCheck says of a frame's predictions: their counts, whether they were wrong, and whether those of the
// frame before were.
typedef struct {
  PredictionCounts counts;
  u32 is_wrong, was_wrong;
} PredictionState;

// What a sweep of BandedSgm needs to know.
typedef struct {
  i32 width, height;
  i32 min_disparity, disparities;
  i32 padding;  // of the census codes' rows
  i32 p1, s_max;
  f32 variance_floor, variance_per_step, variance_per_square;
  i32 reads_off;  // whether the left view leaves ranks for the right one (sgm_cells.h)
} SgmParameters;

// A point whose depth shrinks to less than this part of itself is as good as behind the camera.
#define EGOSGM_MIN_DEPTH_RATIO 1e-6f
// A predicted variance is cut off here: with a deviation of 1000 px nothing is known.
#define EGOSGM_MAX_VARIANCE_PX2 1e6f

// How a view's disparity space moves (eqs. 1-4): rows 1, 2 and 4 of H = Gamma T Gamma^-1; row 3 is (0, 0, 1, 0).
// noise_*: variance of d' by the motion's covariance, over d'^2, as a form in (d', x' - cx, y' - cy).
typedef struct {
  f32 x[4], y[4], w[4];
  f32 cx, cy, doffs;
  f32 noise_dd, noise_dx, noise_dy, noise_xx, noise_xy, noise_yy;
} DisparityMotion;

#ifdef __cplusplus
static_assert(sizeof(ImageSize) == 8 && sizeof(DisparityRange) == 8 && sizeof(Band) == 8 && sizeof(RowSum) == 8 &&
                  sizeof(BlockRange) == 12 && sizeof(PredictionState) == 20 && sizeof(SgmParameters) == 44 &&
                  sizeof(DisparityMotion) == 84,
              "kernels/*.cl read these layouts");
}  // namespace egosgm::shared
#endif

#endif
