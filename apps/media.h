// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <opencv2/highgui.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <string>

namespace egosgm::app {

/// What OpenCV has for images of other formats, videos and windows. These modules bring a hundred libraries, which take
/// longer to load than most commands: only who calls this needs them.
struct Media {
  decltype(&cv::imread) read_image;
  decltype(&cv::imencode) encode_image;
  /// By FFmpeg alone where OpenCV has it: other readers, which it would try next, print. Nothing where it cannot, and
  /// no error is printed; so does the next one.
  std::unique_ptr<cv::VideoCapture> (*open_video)(const std::string& file);
  /// `codec` has four letters. Nothing where it cannot.
  std::unique_ptr<cv::VideoWriter> (*create_video)(const std::string& file, const char* codec, double frames_per_second,
                                                   cv::Size size);
  decltype(&cv::namedWindow) open_window;
  void (*resize_window)(const cv::String& name, const cv::Size& size);
  void (*show)(const cv::String& name, cv::InputArray picture);
  decltype(&cv::waitKeyEx) wait_for_key;
  decltype(&cv::getWindowProperty) window_property;
  decltype(&cv::destroyAllWindows) close_windows;
};

/// Throws IoError where it cannot be loaded.
const Media& media();

}  // namespace egosgm::app
