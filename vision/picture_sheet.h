// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "egosgm/export.h"

namespace egosgm::vision {

struct CaptionedPicture {
  cv::Mat picture;      // CV_8UC3
  std::string caption;  // ASCII; empty: none
};

/// Pictures in rows of `columns`, each scaled down to `cell_width` if wider, its caption above it.
EGOSGM_EXPORT cv::Mat compose(const std::vector<CaptionedPicture>& pictures, int columns, int cell_width);

}  // namespace egosgm::vision
