// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>
#include <string>

namespace egosgm::app {

/// Of a program that says itself, once, what is wrong with a video.
inline void quiet_opencv() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
}

/// By FFmpeg alone where OpenCV has it: other readers, which it would try next, print.
inline bool open_video(cv::VideoCapture& video, const std::string& file) {
  quiet_opencv();
  const auto readers = cv::videoio_registry::getStreamBackends();
  const bool has_ffmpeg = std::find(readers.begin(), readers.end(), cv::CAP_FFMPEG) != readers.end();
  return video.open(file, has_ffmpeg ? cv::CAP_FFMPEG : cv::CAP_ANY);
}

}  // namespace egosgm::app
