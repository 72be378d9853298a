// SPDX-License-Identifier: Apache-2.0
#include "vision/grey_bytes.h"

#include "egosgm/vision/opencv.h"
#include "host/grey_levels.h"

namespace egosgm::vision {

std::pair<cv::Mat, cv::Mat> bytes_of(const cv::Mat& left, const cv::Mat& right) {
  if (left.depth() == CV_8U) return {left, right};
  const GreyLevels levels = levels_of(image_view(left), image_view(right));
  const auto bytes = [&](const cv::Mat& image) {
    cv::Mat result(image.size(), CV_8UC1);
    for (int y = 0; y < image.rows; ++y) {
      std::transform(image.ptr<std::uint16_t>(y), image.ptr<std::uint16_t>(y) + image.cols, result.ptr(y), levels);
    }
    return result;
  };
  return {bytes(left), bytes(right)};
}

}  // namespace egosgm::vision
