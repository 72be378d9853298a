// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>

namespace egosgm::vision {

/// Disparities [px] of a small rectified pair of CV_8UC1 from -half to half - 1; NaN where none is sure.
cv::Mat match_widely(const cv::Mat& left, const cv::Mat& right, int half);

/// An image of CV_8UC1 made smaller: each pixel is the mean of factor x factor ones, of the image moved up by
/// `down_px`.
cv::Mat shrunk_grey(const cv::Mat& image, int factor, double down_px);

}  // namespace egosgm::vision
