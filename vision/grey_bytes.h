// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <utility>

#include "egosgm/export.h"

namespace egosgm::vision {

enum class ColorOrder { kRgb, kBgr };

/// Colours as OpenCV weighs them (cv::COLOR_RGB2GRAY). REQUIRES: three channels or more of CV_8U or CV_16U.
EGOSGM_EXPORT cv::Mat grey_of_colors(const cv::Mat& colors, ColorOrder order);

/// Both images of a pair as CV_8UC1; of 16 bits by levels_of. REQUIRES: one size, both CV_8UC1 or both
/// CV_16UC1.
EGOSGM_EXPORT std::pair<cv::Mat, cv::Mat> bytes_of(const cv::Mat& left, const cv::Mat& right);

}  // namespace egosgm::vision
