// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

// Pictures are kBgr8, BGR. Maps are kF32 with kInvalidDisparity (see disparity_io.h). Wrong types and sizes throw
// InvalidArgument. All functions are thread-safe.

/// The values that the ends of a colour scale stand for.
struct ColorRange {
  double low = 0, high = 128;
  bool logarithmic = false;  // REQUIRES: low > 0
};

/// Zero (or below, if disparities are) to the 99.5th percentile of the valid disparities.
EGOSGM_EXPORT ColorRange disparity_range(const Image& disparity);

inline constexpr ColorRange kVarianceRange{0.01, 10.0, true};  // px^2

/// Turbo colours: blue at `low`, red at `high`; black where invalid.
EGOSGM_EXPORT Image color_map(const Image& map, ColorRange range);

/// Disparity [px], near is red. With a default range the picture's own.
EGOSGM_EXPORT Image color_disparity(const Image& disparity);
EGOSGM_EXPORT Image color_disparity(const Image& disparity, ColorRange range);

/// Variance [px^2] on a logarithmic scale; black where the disparity is invalid.
EGOSGM_EXPORT Image color_variance(const Image& variance, const Image& disparity, ColorRange range = kVarianceRange);

/// |estimate - truth| in ten steps that double, blue below and red above 3 px; black without truth, grey without an
/// estimate. Truth is drawn 3x3 pixels large where its neighbours have none.
EGOSGM_EXPORT Image color_error(const Image& estimate, const Image& truth);

/// A horizontal bar of turbo colours with the range's ends, three values between and `unit`, `width` x 40 pixels.
EGOSGM_EXPORT Image color_bar(int width, ColorRange range, const std::string& unit);

/// The ten steps of color_error with their limits in px, and its grey, `width` x 40 pixels.
EGOSGM_EXPORT Image error_bar(int width);

/// Bytes of egosgm::Reason (`FrameOutputs::reason`), a colour each: black is trusted, what has no value is bluish or
/// grey, what has a doubtful one yellowish or red. Other bytes throw InvalidArgument.
EGOSGM_EXPORT Image color_reasons(const Image& reasons);

/// Their colours and names in two rows, `width` x 80 pixels.
EGOSGM_EXPORT Image reason_bar(int width);

/// Depth [m] = fx * baseline_m / (d + doffs_px), kF32; kInvalidDisparity where the disparity is invalid or d +
/// doffs_px <= 0. Throws as Calibration::validate, too.
EGOSGM_EXPORT Image depth_from_disparity(const Image& disparity, const Calibration& calibration);

}  // namespace egosgm::vision
