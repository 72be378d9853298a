// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/dynamic_map.h"

#include <cmath>

#include "tests/reference/method.h"

namespace egosgm::reference {

std::vector<std::uint8_t> dynamic_map(shared::ImageSize size, const testing::HostMaps& predicted,
                                      const testing::HostMaps& measured) {
  std::vector<std::uint8_t> marks(static_cast<std::size_t>(size.width) * size.height, 0);
  const int radius = kDynamicRadius;
  const auto index = [&](int x, int y) { return static_cast<std::size_t>(y) * size.width + x; };
  const auto has_both = [&](std::size_t i) {
    return predicted.disparity[i] != EGOSGM_INVALID_DISPARITY && measured.disparity[i] != EGOSGM_INVALID_DISPARITY;
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (!has_both(index(x, y))) continue;
      int both = 0, different = 0;
      for (int v = y - radius; v <= y + radius; v += kDynamicStep) {
        for (int u = x - radius; u <= x + radius; u += kDynamicStep) {
          if (u < 0 || u >= size.width || v < 0 || v >= size.height) continue;
          const std::size_t i = index(u, v);
          if (!has_both(i)) continue;
          ++both;
          different += std::abs(measured.disparity[i] - predicted.disparity[i]) > kDifferencePx;
        }
      }
      if (both >= kDynamicMinCount && 2 * different >= both) marks[index(x, y)] = 255;
    }
  }
  return marks;
}

}  // namespace egosgm::reference
