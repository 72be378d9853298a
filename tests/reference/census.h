// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"

namespace egosgm::reference {

/// Codes of one view, without padding, from left to right. `image`: grey values of 8 or 16 `bits`.
std::vector<std::uint64_t> codes(shared::ImageSize size, const std::vector<std::uint16_t>& image, int bits,
                                 MatchingCost cost);

/// Which pixels of the windows of 9x7 pixels of one view are about as bright as their centres: within 16 times the
/// fourth least difference to the eight pixels around it, and half a grey level of 8 bits. `image`: of 16 bits.
std::vector<std::uint64_t> alike_codes(shared::ImageSize size, const std::vector<std::uint16_t>& image);

/// 32-bit words of a code.
int word_count(MatchingCost cost);

/// Both views' codes as the kernel lays them out: 32-bit words, low word first, in padded rows, the right view's from
/// right to left.
std::vector<std::uint32_t> padded_codes(shared::ImageSize size, const std::vector<std::uint64_t>& left,
                                        const std::vector<std::uint64_t>& right, int padding, MatchingCost cost);

}  // namespace egosgm::reference
