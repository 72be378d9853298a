// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Counts of a comparison of one disparity map with its truth, over pixels that have truth. Counts of several images
/// add up (KITTI 2015 pools pixels); KITTI 2012 instead averages each image's figures (mean_of). `bad`: |error| > 3 px.
/// `d1`: bad, and |error| > 5 % of the truth. `interpolated`: after interpolate_background. Where the truth says that
/// nothing is there (is_sky), a hole is right: it is neither missing nor filled.
struct EGOSGM_EXPORT DisparityCounts {
  std::int64_t truth = 0;             // pixels with truth
  std::int64_t valid = 0;             // of these, with an estimate
  std::int64_t bad = 0;               // of these, bad
  std::int64_t bad_1px = 0;           // of the valid ones: |error| > 1 px
  std::int64_t d1 = 0;                // of the valid ones
  std::int64_t bad_interpolated = 0;  // of all with truth
  std::int64_t d1_interpolated = 0;   // of all with truth
  double absolute_error_px = 0;       // sum over the valid ones
  double signed_error_px = 0;         // sum of estimate - truth over the valid ones
  std::int64_t sky = 0;               // of all with truth: nothing is there
  std::int64_t sky_valid = 0;         // of these, with an estimate

  DisparityCounts& operator+=(const DisparityCounts& other);
};

/// The figures, in percent of the pixels with truth unless said otherwise. NaN where there is nothing to divide by.
struct DisparityMetrics {
  double bad_or_missing = 0;   // bad, or a surface without an estimate
  double bad_1px = 0;          // off by more than 1 px, or a surface without an estimate
  double bad_of_valid = 0;     // percent of the pixels with an estimate
  double density = 0;          // percent of the pixels with a surface: those with an estimate
  double interpolated = 0;     // bad after background interpolation: KITTI 2012's official figure
  double d1 = 0;               // KITTI 2015's rule, or a surface without an estimate
  double d1_interpolated = 0;  // KITTI 2015's official figure
  double mae_px = 0;           // mean absolute error of the pixels with an estimate [px]
  double mean_error_px = 0;    // mean signed error of the pixels with an estimate [px]: below 0, they look too far
  double filled = 0;           // with an estimate, whether a surface is there or not
  double wrong_of_all = 0;     // bad: what is missing does not count
};

/// Both kF32 with kInvalidDisparity (see disparity_io.h). Throws InvalidArgument where sizes or types differ.
/// Thread-safe.
EGOSGM_EXPORT DisparityCounts compare_disparity(const Image& estimate, const Image& truth);

EGOSGM_EXPORT DisparityMetrics metrics_of(const DisparityCounts& counts);

/// The mean of each image's figures, images whose figure is NaN left out (KITTI 2012).
EGOSGM_EXPORT DisparityMetrics mean_of(const std::vector<DisparityMetrics>& images);

/// A bound on OutputVariance: pixels above it are wrong about as often as those that the background would fill in.
constexpr float kCertainVariancePx2 = 6.0f;

/// Fills the holes from the background, as KITTI's development kit does: in each row, a run of invalid pixels between
/// two valid ones gets the smaller of the two, the ends of a row its nearest valid value; then the top and bottom of
/// each column get its nearest valid value. A map without any valid pixel stays so. Thread-safe.
EGOSGM_EXPORT Image interpolate_background(const Image& disparity);

/// Disparities [px] without those of a variance [px^2] above the bound: of a video, interpolate_background of what is
/// left is a little better than of all. Both kF32 of one size, else InvalidArgument. Thread-safe.
EGOSGM_EXPORT Image drop_uncertain(const Image& disparity, const Image& variance,
                                   float max_variance_px2 = kCertainVariancePx2);

}  // namespace egosgm::vision
