// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/motion.h"

namespace egosgm::bench {

struct ClipFrame {
  cv::Mat left, right;           // CV_8UC1
  std::optional<Motion> motion;  // since the frame before
};

/// A few consecutive frames of a stereo video, to be played from the start: the last ones are steady.
struct Clip {
  std::string title;
  Calibration calibration;
  std::vector<ClipFrame> frames;

  static constexpr std::size_t kSteadyFrom = 3;  // frames before this one only lead there
};

/// KITTI 2012 scene 000151, frames 07..11, resized to `size` with its calibration, if $EGOSGM_DATA or ../shared/data
/// beside the project has it (motion by StereoOdometry, at the original size); else a synthetic street of five frames,
/// with true motion.
Clip load_clip(cv::Size size);

}  // namespace egosgm::bench
