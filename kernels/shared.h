// SPDX-License-Identifier: Apache-2.0
// Layouts that the host and the kernels share, in the C that both compile. The method's constants: method.h.
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

#ifndef __cplusplus
// Some compilers (PoCL) make three of a kernel and of what is inlined into it. What a kernel does is therefore a
// function of its own, which takes what a work-item knows of itself. Not where work-items are lanes: there calls are
// dear.
#if defined(PIXELS) && PIXELS > 1
#define COMPILED_ONCE static __attribute__((noinline))
#else
#define COMPILED_ONCE static inline
#endif
typedef struct {
  int x, items, y, view;  // global ids 0, 1 and 2; how many work-items there are along the first
} WorkItem;
#define THIS_WORK_ITEM ((WorkItem){get_global_id(0), get_global_size(0), get_global_id(1), get_global_id(2)})
#endif

// A pixel without a disparity; include/egosgm/image.h says the same to users.
#define EGOSGM_INVALID_DISPARITY (-32768.0f)
// In place of the variance of a prediction: a surface that came nearer than the range hides what is there
// (ForwardWarp).
#define EGOSGM_HIDDEN (-1.0f)

// Maps and images of a stereo pair lie in one buffer, the left view first: index view * width * height + y * width + x.
#define EGOSGM_LEFT 0
#define EGOSGM_RIGHT 1
#ifndef __cplusplus
// Of both views, every row_step-th row is there, from the first one on. What lies between is neither written nor read.
static inline bool has_row(const WorkItem at, const int row_step) { return at.y % row_step == 0; }
#endif

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

// VerticalAlignment's quadratic: 1, u, v, u v, u^2, v^2.
#define EGOSGM_OFFSET_TERMS 6

// The reasons of a pixel: include/egosgm/reason.h.
#define EGOSGM_REASON_TRUSTED 0
#define EGOSGM_REASON_UNCONFIRMED 1
#define EGOSGM_REASON_UNCOVERED 2
#define EGOSGM_REASON_CONTRADICTED 3
#define EGOSGM_REASON_NEARER 4
#define EGOSGM_REASON_AMBIGUOUS 5
#define EGOSGM_REASON_FLAT 6
#define EGOSGM_REASON_SATURATED 7
#define EGOSGM_REASON_SPECKLE 8
#define EGOSGM_REASON_PREDICTED 9

typedef struct {
  i32 width, height;
} ImageSize;

// The size of what has one for EGOSGM_COARSE x EGOSGM_COARSE pixels of an image, or for those that its edge leaves.
static inline ImageSize coarse_size(const ImageSize size) {
  const ImageSize coarse = {(size.width + EGOSGM_COARSE - 1) / EGOSGM_COARSE,
                            (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE};
  return coarse;
}

// Disparities [min, min + count).
typedef struct {
  i32 min, count;
} DisparityRange;

// The band of a pixel. Lanes origin .. origin + chunks * EGOSGM_LANES - 1 are computed; first .. last (inclusive) can
// win.
typedef struct {
  i16 origin;
  u16 chunks;
  i16 first, last;
} Band;

#ifndef __cplusplus
// By one load of eight bytes, which compilers do not make of four members of two.
static inline Band band_at(global const Band* bands, const size_t at) {
  const short4 members = ((global const short4*)bands)[at];
  const Band band = {members.x, (ushort)members.y, members.z, members.w};
  return band;
}
#endif

// The search of a row of a view: cells, which are lanes of its bands, also those that cannot win; predicted pixels.
typedef struct {
  u32 cells, predicted;
} RowSum;

// The predictions in a block of EGOSGM_BLOCK x EGOSGM_BLOCK pixels; count 0: none.
typedef struct {
  f32 min, max;
  u32 count;
} BlockRange;

// The evidence of a block of EGOSGM_COARSE x EGOSGM_COARSE pixels, of those that were asked; how many these are.
typedef struct {
  i32 sum, count;
} EvidenceSum;

// Parameters of a sweep of BandedSgm.
typedef struct {
  i32 width, height;
  i32 min_disparity, disparities;
  i32 padding;  // of the census codes' rows
  i32 p1, s_max;
  f32 variance_floor, variance_per_step, variance_per_square;
  i32 reads_off;  // whether the left view leaves ranks for the right one (sgm_cells.h)
  i32 row_step;
  i32 first_view;  // of those that are matched, which lie one behind the other in what only a match needs
} SgmParameters;

// Parameters of KalmanUpdate. Without a gate (gate_px infinite), all that is predicted and measured is averaged, and
// nothing is hidden or doubtful.
typedef struct {
  i32 width, height;
  f32 gate_px, min_variance_px2;
  i32 keep_predicted;
  i32 has_evidence;  // else what the frame knows of evidence is not read, and all that lives is confirmed
  i32 repeats;       // the images are those of the frame before, which make nobody surer
  i32 sees_again;    // the camera stands: what has no prediction was turned down a frame before
  i32 row_step;
} KalmanParameters;

// The motion of a view's disparity space (eqs. 1-4): rows 1, 2 and 4 of H = Gamma T Gamma^-1; row 3 is (0, 0, 1, 0).
// noise_*: variance of d' by the motion's covariance, over d'^2, as a form in (d', x' - cx, y' - cy).
typedef struct {
  f32 x[4], y[4], w[4];
  f32 cx, cy, doffs;
  i32 row_step;  // of the view's rows, every so many-th is moved, and landed on
  f32 noise_dd, noise_dx, noise_dy, noise_xx, noise_xy, noise_yy;
} DisparityMotion;

#ifdef __cplusplus
static_assert(sizeof(ImageSize) == 8 && sizeof(DisparityRange) == 8 && sizeof(Band) == 8 && sizeof(RowSum) == 8 &&
                  sizeof(BlockRange) == 12 && sizeof(EvidenceSum) == 8 && sizeof(SgmParameters) == 52 &&
                  sizeof(KalmanParameters) == 36 && sizeof(DisparityMotion) == 88,
              "kernels/*.cl read these layouts");
}  // namespace egosgm::shared
#endif

#endif
