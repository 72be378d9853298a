// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/sad_check.h"

#include <cmath>
#include <cstdlib>

namespace egosgm::reference {

testing::HostMaps sad_check(shared::ImageSize size, const SadCheckOptions& options, const std::vector<int>& images,
                            int steps_per_grey, const testing::HostMaps& in) {
  const auto index = [&](int view, int x, int y) {
    return (static_cast<std::size_t>(view) * size.height + y) * size.width + x;
  };
  const auto is_inside = [&](int x, int y) { return x >= 0 && x < size.width && y >= 0 && y < size.height; };
  testing::HostMaps out = in;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const float d = in.disparity[index(view, x, y)];
        if (!(d > EGOSGM_INVALID_DISPARITY)) continue;
        const int steps = static_cast<int>(std::nearbyint(d));
        const int match = view == EGOSGM_LEFT ? x - steps : x + steps;
        int sum = 0, count = 0;
        for (int v = -1; v <= 1; ++v) {
          for (int u = -1; u <= 1; ++u) {
            if (!is_inside(x + u, y + v) || !is_inside(match + u, y + v)) continue;
            sum += std::abs(images[index(view, x + u, y + v)] - images[index(1 - view, match + u, y + v)]);
            ++count;
          }
        }
        const bool keeps =
            is_inside(match, y) &&
            static_cast<float>(sum) <= options.max_difference * static_cast<float>(count * steps_per_grey);
        if (!keeps) out.disparity[index(view, x, y)] = EGOSGM_INVALID_DISPARITY;
      }
    }
  }
  return out;
}

}  // namespace egosgm::reference
