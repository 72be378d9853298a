// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/speckle_removal.h"

#include <cmath>

namespace egosgm::reference {

// Flood fill from every pixel that no earlier fill has reached.
testing::HostMaps speckle_removal(shared::ImageSize size, const SpeckleRemovalOptions& options,
                                  const testing::HostMaps& in) {
  testing::HostMaps out = in;
  if (options.max_size_px <= 0) return out;
  const std::size_t width = size.width, pixels = width * size.height;
  std::vector<bool> reached(in.disparity.size());
  for (std::size_t seed = 0; seed < reached.size(); ++seed) {
    if (reached[seed] || !(in.disparity[seed] > EGOSGM_INVALID_DISPARITY)) continue;
    std::vector<std::size_t> region{seed};
    reached[seed] = true;
    const auto visit = [&](std::size_t from, std::size_t to) {
      const float a = in.disparity[from], b = in.disparity[to];
      if (reached[to] || !(b > EGOSGM_INVALID_DISPARITY) || !(std::fabs(a - b) <= options.max_difference_px)) return;
      reached[to] = true;
      region.push_back(to);
    };
    for (std::size_t next = 0; next < region.size(); ++next) {
      const std::size_t i = region[next], x = i % width, y = i % pixels / width;
      if (x > 0) visit(i, i - 1);
      if (x + 1 < width) visit(i, i + 1);
      if (y > 0) visit(i, i - width);
      if (y + 1 < static_cast<std::size_t>(size.height)) visit(i, i + width);
    }
    if (region.size() > static_cast<std::size_t>(options.max_size_px)) continue;
    for (const std::size_t i : region) out.disparity[i] = EGOSGM_INVALID_DISPARITY;
  }
  return out;
}

}  // namespace egosgm::reference
