// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "egosgm/calibration.h"
#include "egosgm/export.h"

namespace egosgm::vision {

// Pictures are CV_8UC3, BGR. Maps are CV_32FC1 with kInvalidDisparity (see disparity_io.h). Wrong types and sizes throw
// InvalidArgument. All functions are thread-safe.

/// The values that the ends of a colour scale stand for.
struct ColorRange {
  double low = 0, high = 128;
  bool logarithmic = false;  // REQUIRES: low > 0
};

/// Zero (or below, if disparities are) to the 99.5th percentile of the valid disparities.
EGOSGM_EXPORT ColorRange disparity_range(const cv::Mat& disparity);

inline constexpr ColorRange kVarianceRange{0.01, 10.0, true};  // px^2

/// Turbo colours: blue at `low`, red at `high`; black where invalid.
EGOSGM_EXPORT cv::Mat color_map(const cv::Mat& map, ColorRange range);

/// Disparity [px], near is red. With a default range the picture's own.
EGOSGM_EXPORT cv::Mat color_disparity(const cv::Mat& disparity);
EGOSGM_EXPORT cv::Mat color_disparity(const cv::Mat& disparity, ColorRange range);

/// Variance [px^2] on a logarithmic scale; black where the disparity is invalid.
EGOSGM_EXPORT cv::Mat color_variance(const cv::Mat& variance, const cv::Mat& disparity,
                                     ColorRange range = kVarianceRange);

/// |estimate - truth| in ten steps that double, blue below and red above 3 px; black without truth, grey without an
/// estimate. Truth is drawn 3x3 pixels large where its neighbours have none.
EGOSGM_EXPORT cv::Mat color_error(const cv::Mat& estimate, const cv::Mat& truth);

/// A horizontal bar of turbo colours with the range's ends, three values between and `unit`, `width` x 40 pixels.
EGOSGM_EXPORT cv::Mat color_bar(int width, ColorRange range, const std::string& unit);

/// The ten steps of color_error with their limits in px, and its grey, `width` x 40 pixels.
EGOSGM_EXPORT cv::Mat error_bar(int width);

/// Bytes of egosgm::Reason (`FrameOutputs::reason`), a colour each: black is trusted, what has no value is bluish or
/// grey, what has a doubtful one yellowish or red. Other bytes throw InvalidArgument.
EGOSGM_EXPORT cv::Mat color_reasons(const cv::Mat& reasons);

/// Their colours and names in two rows, `width` x 80 pixels.
EGOSGM_EXPORT cv::Mat reason_bar(int width);

/// Grey (8 or 16 bit; 16 bit is stretched to its own maximum) as BGR.
EGOSGM_EXPORT cv::Mat color_grey(const cv::Mat& grey);

/// Depth [m] = fx * baseline_m / (d + doffs_px), CV_32FC1; kInvalidDisparity where the disparity is invalid or d +
/// doffs_px <= 0. Throws as Calibration::validate, too.
EGOSGM_EXPORT cv::Mat depth_from_disparity(const cv::Mat& disparity, const Calibration& calibration);

}  // namespace egosgm::vision
