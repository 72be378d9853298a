// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "kernels/shared.h"

namespace egosgm::reference {

/// Disparities without those of textureless regions that run out of the image at its top and of which fewer than half
/// of the pixels have one. `images`: of both views.
std::vector<float> textureless_regions(shared::ImageSize size, const std::vector<int>& images, int row_step,
                                       std::vector<float> disparity);

}  // namespace egosgm::reference
