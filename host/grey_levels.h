// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

#include "egosgm/export.h"
#include "egosgm/image.h"

namespace egosgm {

/// Maps grey values to 8 bits: the values of nearly all pixels fill the 8 bits. A pedestal below and a few hot pixels
/// above do not count; where neither is there, values of 16 bits are shifted alone, and those of 8 bits stay.
struct GreyLevels {
  int pedestal = 0, gain = 1, shift = 0;

  bool operator==(const GreyLevels&) const = default;
  /// The difference of values that are one 8-bit level apart.
  float step() const { return static_cast<float>(1 << shift) / static_cast<float>(gain); }

  std::uint8_t operator()(int value) const {
    return static_cast<std::uint8_t>(std::min(255, (std::max(0, value - pedestal) * gain) >> shift));
  }
};

/// Levels for both images of a pair, so that they stay comparable. REQUIRES: both are of one type.
EGOSGM_EXPORT GreyLevels levels_of(const ImageView& left, const ImageView& right);

}  // namespace egosgm
