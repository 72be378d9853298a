// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "egosgm/frame.h"

namespace egosgm {

/// Tells pairs of images apart: two of one size that differ in one word never have equal hashes, and others by chance.
using PairHash = std::array<std::uint32_t, 64>;  // as many as fill the vectors of a CPU

PairHash hash_of(const ImageView& left, const ImageView& right);

}  // namespace egosgm
