// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/consistency_check.h"

#include <cmath>

namespace egosgm::reference {

testing::HostMaps consistency_check(shared::ImageSize size, float max_difference_px, bool keep_outside,
                                    const testing::HostMaps& in) {
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  testing::HostMaps out{std::vector<float>(2 * pixels, EGOSGM_INVALID_DISPARITY), in.variance, in.hidden};
  for (std::size_t i = 0; i < 2 * pixels; ++i) {
    const bool is_left = i < pixels;
    const std::size_t x = i % size.width, y = i % pixels / size.width;
    const float d = in.disparity[i];
    if (d == EGOSGM_INVALID_DISPARITY) continue;
    const float other_x = std::nearbyint(is_left ? static_cast<float>(x) - d : static_cast<float>(x) + d);
    const bool inside = other_x >= 0 && other_x < static_cast<float>(size.width);
    if (!inside && !keep_outside) continue;
    if (inside) {
      const float other = in.disparity[(is_left ? pixels : 0) + y * size.width + static_cast<std::size_t>(other_x)];
      if (other == EGOSGM_INVALID_DISPARITY || std::abs(other - d) > max_difference_px) continue;
    }
    out.disparity[i] = d;
  }
  return out;
}

}  // namespace egosgm::reference
