// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/consistency_check.h"

#include <cmath>
#include <vector>

namespace egosgm::reference {
testing::HostMaps consistency_check(shared::ImageSize size, float max_difference_px, bool keep_outside,
                                    const testing::HostMaps& in, cl_int row_step) {
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  testing::HostMaps out{std::vector<float>(2 * pixels, EGOSGM_INVALID_DISPARITY), in.variance, in.hidden};
  for (std::size_t i = 0; i < 2 * pixels; ++i) {
    const bool is_left = i < pixels;
    const int x = static_cast<int>(i % size.width), y = static_cast<int>(i % pixels / size.width);
    const float d = in.disparity[i];
    if (d == EGOSGM_INVALID_DISPARITY || y % row_step != 0) continue;
    const float other_x = std::nearbyint(is_left ? static_cast<float>(x) - d : static_cast<float>(x) + d);
    bool keeps = false;
    if (!(other_x >= 0 && other_x < static_cast<float>(size.width))) {
      keeps = keep_outside;
    } else {
      const float other = in.disparity[(is_left ? pixels : 0) + static_cast<std::size_t>(y) * size.width +
                                       static_cast<std::size_t>(other_x)];
      keeps = other != EGOSGM_INVALID_DISPARITY && std::abs(other - d) <= max_difference_px;
    }
    if (keeps) out.disparity[i] = d;
  }
  return out;
}

}  // namespace egosgm::reference
