// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/shared.h"

namespace egosgm::reference {

/// Codes of one view, without padding, from left to right.
std::vector<std::uint64_t> census(shared::ImageSize size, const std::vector<std::uint16_t>& image, int radius_x, int radius_y);

/// Both views' codes as the kernel lays them out: padded rows, the right view's from right to left.
std::vector<std::uint64_t> padded_codes(shared::ImageSize size, const std::vector<std::uint64_t>& left,
                                        const std::vector<std::uint64_t>& right, int padding);

}  // namespace egosgm::reference
