// SPDX-License-Identifier: Apache-2.0
// A library of its own where libraries are shared: nothing else may call these modules of OpenCV.
#include "apps/media.h"

#include <algorithm>
#include <cstdlib>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio/registry.hpp>

namespace egosgm::app {
namespace {

void quiet_opencv() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
}

std::unique_ptr<cv::VideoCapture> open_video(const std::string& file) {
  quiet_opencv();
  const auto readers = cv::videoio_registry::getStreamBackends();
  const bool has_ffmpeg = std::find(readers.begin(), readers.end(), cv::CAP_FFMPEG) != readers.end();
  auto video = std::make_unique<cv::VideoCapture>(file, has_ffmpeg ? cv::CAP_FFMPEG : cv::CAP_ANY);
  return video->isOpened() ? std::move(video) : nullptr;
}

}  // namespace

extern "C" __attribute__((visibility("default"))) const Media egosgm_media{cv::imread, cv::imencode, open_video};

}  // namespace egosgm::app
