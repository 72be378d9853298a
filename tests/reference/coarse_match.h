// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"

namespace egosgm::reference {

/// Both views' images at a quarter of the resolution, 16 bits. `images`: grey values of 8 or 16 `bits`.
std::vector<std::uint16_t> shrink(shared::ImageSize size, const std::vector<int>& images, int bits);

/// Left-right consistent disparities of both views, of EGOSGM_COARSE x EGOSGM_COARSE pixels each.
std::vector<float> coarse_match(shared::ImageSize size, const MethodOptions& options, const std::vector<int>& images,
                                int bits);

}  // namespace egosgm::reference
