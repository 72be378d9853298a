// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/shared.h"

namespace egosgm::reference {

/// The left view of a frame, with grey values of 8 or 16 bits.
struct LeftView {
  std::vector<int> greys;
  int bits;
  std::vector<float> disparity;
};

/// `previous_from_current` moves the left view's disparity space back to the last frame.
std::vector<std::uint8_t> dynamic_map(shared::ImageSize size, const LeftView& last, const LeftView& current,
                                      const shared::DisparityMotion& previous_from_current);

}  // namespace egosgm::reference
