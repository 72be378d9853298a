// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "egosgm/export.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Both images of a pair as kU8; of 16 bits by levels_of. REQUIRES: one size, both kU8 or both
/// kU16.
EGOSGM_EXPORT std::pair<Image, Image> bytes_of(const Image& left, const Image& right);

}  // namespace egosgm::vision
