// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/edge_variance.h"

#include <algorithm>

namespace egosgm::reference {

testing::HostMaps edge_variance(shared::ImageSize size, float weight, const testing::HostMaps& maps) {
  testing::HostMaps out = maps;
  const int radius = EGOSGM_EDGE_RADIUS;
  for (int view = 0; view < 2; ++view) {
    const auto index = [&](int x, int y) {
      return (static_cast<std::size_t>(view) * size.height + y) * size.width + x;
    };
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const float d = maps.disparity[index(x, y)];
        if (d == EGOSGM_INVALID_DISPARITY) continue;
        float least = d, largest = d;
        for (int v = std::max(y - radius, 0); v <= std::min(y + radius, size.height - 1); ++v) {
          for (int u = std::max(x - radius, 0); u <= std::min(x + radius, size.width - 1); ++u) {
            const float other = maps.disparity[index(u, v)];
            if (other == EGOSGM_INVALID_DISPARITY) continue;
            least = std::min(least, other);
            largest = std::max(largest, other);
          }
        }
        const float range = largest - least;
        out.variance[index(x, y)] = std::max(maps.variance[index(x, y)], weight * (range * range));
      }
    }
  }
  return out;
}

}  // namespace egosgm::reference
