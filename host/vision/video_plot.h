// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/video_counts.h"

namespace egosgm::vision {

/// Over the frames: flicker, both TEPE and the mean absolute error [px], as far as they are known. Throws
/// InvalidArgument where none is, or there are fewer than two frames. Thread-safe.
EGOSGM_EXPORT cv::Mat draw_over_frames(const std::vector<VideoCounts>& frames);  // BGR
EGOSGM_EXPORT std::string over_frames_svg(const std::vector<VideoCounts>& frames);

/// Bad pixels of those kept, against the share that is kept: in the order of the uncertainty, and the oracle's. Throws
/// InvalidArgument where nothing was counted. Thread-safe.
EGOSGM_EXPORT cv::Mat draw_density(const DensityCounts& counts);  // BGR
EGOSGM_EXPORT std::string density_svg(const DensityCounts& counts);

}  // namespace egosgm::vision
