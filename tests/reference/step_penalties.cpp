// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/step_penalties.h"

#include <algorithm>
#include <cstdlib>

namespace egosgm::reference {

int step_penalty(const BandedSgmOptions& options, int p, int q) {
  return std::min(options.p2, std::max(options.p2_at_edges, options.p2 - options.p2_slope * std::abs(p - q)));
}

std::vector<std::uint8_t> step_penalties(shared::ImageSize size, const std::vector<std::uint16_t>& images, int bits,
                                         const BandedSgmOptions& options, cl_int row_step) {
  std::vector<std::uint8_t> penalties;
  for (int view = 0; view < 2; ++view) {
    const int steps[4][2] = {{-1, 0}, {0, -row_step}, {-1, -row_step}, {1, -row_step}};
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        const auto at = [&](int u, int v) {
          const int inside_u = std::clamp(u, 0, size.width - 1), inside_v = v < 0 ? y : v;
          return images[(static_cast<std::size_t>(view) * size.height + inside_v) * size.width + inside_u] >>
                 (bits - 8);
        };
        for (const auto& [dx, dy] : steps) {
          penalties.push_back(static_cast<std::uint8_t>(step_penalty(options, at(x, y), at(x + dx, y + dy))));
        }
      }
    }
  }
  return penalties;
}

}  // namespace egosgm::reference
