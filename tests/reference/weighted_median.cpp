// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/weighted_median.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <utility>

#include "tests/reference/method.h"
#include "tests/reference/present_rows.h"

namespace egosgm::reference {

namespace {

struct Vote {
  int place, weight;
  float disparity;
};

int place_of(shared::DisparityRange range, float disparity) {
  const int steps_per_px = 1 << static_cast<int>(std::log2(((1 << 15) - 1) / (range.count + 2)));
  return static_cast<int>((disparity - static_cast<float>(range.min - 1)) * static_cast<float>(steps_per_px));
}

}  // namespace

testing::HostMaps weighted_median(shared::ImageSize size, shared::DisparityRange range,
                                  const std::vector<std::uint16_t>& greys, const testing::HostMaps& in,
                                  cl_int row_step) {
  static constexpr std::pair<int, int> kCircle[] = {{0, 0}, {0, -4}, {-3, -2}, {3, -2}, {-4, 0},
                                                    {4, 0}, {-3, 2}, {3, 2},   {0, 4}};
  testing::HostMaps out = without_absent_rows(size, row_step, in);
  for (int row = 0; row < 2 * size.height; ++row) {
    const int y = row % size.height;
    for (int x = 0; x < size.width && y % row_step == 0; ++x) {
      const auto index = [&](int u, int v) { return static_cast<std::size_t>(row - y + v) * size.width + u; };
      std::vector<Vote> votes;
      int total = 0;
      for (const auto& [dx, dy] : kCircle) {
        const int u = x + dx, v = y + dy;
        if (u < 0 || u >= size.width || v < 0 || v >= size.height) continue;
        const float d = in.disparity[index(u, v)];
        const int weight = kVoteGreys - std::abs(greys[index(u, v)] - greys[index(x, y)]);
        if (d == EGOSGM_INVALID_DISPARITY || weight <= 0) continue;
        votes.push_back({place_of(range, d), weight, d});
        total += weight;
      }
      const std::size_t i = index(x, y);
      const bool is_hole = in.disparity[i] == EGOSGM_INVALID_DISPARITY;
      if (is_hole && votes.size() < kFillMinCount) continue;
      std::stable_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) { return a.place < b.place; });
      auto middle = votes.begin();
      for (int sum = middle->weight; 2 * sum < total; sum += middle->weight) ++middle;
      while (middle != votes.begin() && std::prev(middle)->place == middle->place) --middle;
      out.disparity[i] = middle->disparity;
      if (is_hole) out.variance[i] = kFilledVariancePx2;
    }
  }
  return out;
}

}  // namespace egosgm::reference
