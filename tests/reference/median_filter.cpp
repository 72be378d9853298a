// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/median_filter.h"

#include <algorithm>

#include "tests/reference/present_rows.h"

namespace egosgm::reference {

namespace {

testing::HostMaps filter(shared::ImageSize size, const testing::HostMaps& in) {
  testing::HostMaps out = in;
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  for (std::size_t view = 0; view < 2; ++view) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto at = [&](int u, int v) { return view * pixels + static_cast<std::size_t>(v) * size.width + u; };
        const float centre = in.disparity[at(x, y)];
        if (centre == EGOSGM_INVALID_DISPARITY) continue;
        std::vector<float> votes;
        for (int v = y - 1; v <= y + 1; ++v) {
          for (int u = x - 1; u <= x + 1; ++u) {
            const bool inside = u >= 0 && u < size.width && v >= 0 && v < size.height;
            const bool counts = inside && in.disparity[at(u, v)] != EGOSGM_INVALID_DISPARITY;
            votes.push_back(counts ? in.disparity[at(u, v)] : centre);
          }
        }
        std::sort(votes.begin(), votes.end());
        out.disparity[at(x, y)] = votes[votes.size() / 2];
      }
    }
  }
  return out;
}

}  // namespace

testing::HostMaps median_filter(shared::ImageSize size, const testing::HostMaps& in, cl_int row_step) {
  return of_present_rows(size, row_step, in,
                         [&](shared::ImageSize of, const testing::HostMaps& maps) { return filter(of, maps); });
}

}  // namespace egosgm::reference
