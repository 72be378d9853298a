// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

struct CaptionedPicture {
  Image picture;        // kBgr8
  std::string caption;  // ASCII; empty: none
};

/// Pictures in rows of `columns`, each scaled down to `cell_width` if wider, its caption above it.
EGOSGM_EXPORT Image compose(const std::vector<CaptionedPicture>& pictures, int columns, int cell_width);

}  // namespace egosgm::vision
