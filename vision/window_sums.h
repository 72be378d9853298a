// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "vision/pixel_group.h"

namespace egosgm::vision {

/// Values of the pixels of a box, row by row. kNoValue: none.
using BoxValues = std::vector<float>;

/// The mean of `values` around each pixel of a box that has a disparity: over 5x5 pixels, two apart, whose disparities
/// are alike. 0 where two or fewer of them have a value.
BoxValues means_of_alike(const Box& box, const BoxValues& disparities, const BoxValues& values);

}  // namespace egosgm::vision
