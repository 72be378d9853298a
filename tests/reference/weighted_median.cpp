// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/weighted_median.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "tests/reference/method.h"
#include "tests/reference/present_rows.h"

namespace egosgm::reference {

testing::HostMaps weighted_median(shared::ImageSize size, const std::vector<std::uint16_t>& greys,
                                  const testing::HostMaps& in, cl_int row_step) {
  static constexpr std::pair<int, int> kCircle[] = {{0, 0}, {0, -4}, {-3, -2}, {3, -2}, {-4, 0},
                                                    {4, 0}, {-3, 2}, {3, 2},   {0, 4}};
  testing::HostMaps out = without_absent_rows(size, row_step, in);
  for (int row = 0; row < 2 * size.height; ++row) {
    const int y = row % size.height;
    for (int x = 0; x < size.width && y % row_step == 0; ++x) {
      const auto index = [&](int u, int v) { return static_cast<std::size_t>(row - y + v) * size.width + u; };
      std::vector<std::pair<float, int>> votes;
      int total = 0;
      for (const auto& [dx, dy] : kCircle) {
        const int u = x + dx, v = y + dy;
        if (u < 0 || u >= size.width || v < 0 || v >= size.height) continue;
        const float d = in.disparity[index(u, v)];
        const int weight = kVoteGreys - std::abs(greys[index(u, v)] - greys[index(x, y)]);
        if (d == EGOSGM_INVALID_DISPARITY || weight <= 0) continue;
        votes.emplace_back(d, weight);
        total += weight;
      }
      const std::size_t i = index(x, y);
      const bool is_hole = in.disparity[i] == EGOSGM_INVALID_DISPARITY;
      if (is_hole && votes.size() < kFillMinCount) continue;
      std::sort(votes.begin(), votes.end());
      auto middle = votes.begin();
      for (int sum = middle->second; 2 * sum < total; sum += middle->second) ++middle;
      out.disparity[i] = middle->first;
      if (is_hole) out.variance[i] = kFilledVariancePx2;
    }
  }
  return out;
}

}  // namespace egosgm::reference
