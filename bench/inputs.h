// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/motion.h"
#include "egosgm/vision/image.h"

namespace egosgm::bench {

struct ClipFrame {
  vision::Image left, right;     // kU8
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
Clip load_clip(vision::Size size);

}  // namespace egosgm::bench
