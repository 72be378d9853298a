// SPDX-License-Identifier: Apache-2.0
// What pictures of maps are drawn with.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace egosgm::vision {

/// Throws InvalidArgument unless a picture may be so wide.
void require_width(int width);

/// The colour of a place in 0..1 on the scale Turbo (Mikhailov 2019), BGR.
cv::Vec3b turbo(double position);

/// Letters are 7 pixels high, times `scale`.
int text_width(const std::string& text, int scale);
/// White letters of ASCII; what lies outside of the picture, CV_8UC3, is cut off. The lowest row is that above
/// `bottom`.
void draw_text(cv::Mat& picture, const std::string& text, int left, int bottom, int scale);

/// A CV_8UC3 picture made smaller: each pixel is the mean of what it covers. REQUIRES: `size` is not larger.
cv::Mat shrunk(const cv::Mat& picture, cv::Size size);

}  // namespace egosgm::vision
