// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "egosgm/export.h"

namespace egosgm::vision {

/// Reads optical flow [px], CV_32FC2 (x to the right, y down), NaN where there is none: KITTI's PNG (16-bit RGB, red
/// and green are 64 times the flow plus 32768, blue 0 where there is none) or Middlebury's .flo. The file's first bytes
/// tell which. Throws InvalidArgument, naming the file, for what cannot be read. Thread-safe.
EGOSGM_EXPORT cv::Mat read_flow(const std::filesystem::path& file);

}  // namespace egosgm::vision
