// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <string>

namespace egosgm::app {

/// What OpenCV has for images of other formats and videos. These modules bring a hundred libraries, which take
/// longer to load than most commands: only who calls this needs them.
struct Media {
  decltype(&cv::imread) read_image;
  decltype(&cv::imencode) encode_image;
  /// By FFmpeg alone where OpenCV has it: other readers, which it would try next, print. Nothing where it cannot, and
  /// no error is printed.
  std::unique_ptr<cv::VideoCapture> (*open_video)(const std::string& file);
};

/// Throws IoError where it cannot be loaded.
const Media& media();

}  // namespace egosgm::app
