// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/right_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace egosgm::reference {
namespace {

struct Winner {
  bool lands = false, was_measured = false;
  std::uint32_t steps = 0;  // of the disparity, from one pixel below the range
};

bool wins(const Winner& one, const Winner& other) {
  return std::pair(one.was_measured, one.steps) > std::pair(other.was_measured, other.steps);
}

}  // namespace

testing::HostMaps right_map(shared::ImageSize size, int min_disparity, float max_difference_px,
                            const testing::HostMaps& measured, const testing::HostMaps& maps) {
  const std::size_t width = size.width, pixels = width * size.height;
  std::vector<Winner> winners(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float d = maps.disparity[i], z = measured.disparity[i];
    if (d == EGOSGM_INVALID_DISPARITY) continue;
    const float right_x = std::nearbyint(static_cast<float>(i % width) - d);
    if (!(right_x >= 0 && right_x < static_cast<float>(width))) continue;
    const float steps = (d - static_cast<float>(min_disparity) + 1) * EGOSGM_RIGHT_MAP_STEPS_PER_PX;
    const Winner bidder{true, z != EGOSGM_INVALID_DISPARITY && std::abs(z - d) <= max_difference_px,
                        static_cast<std::uint32_t>(steps)};
    Winner& winner = winners[i / width * width + static_cast<std::size_t>(right_x)];
    if (!winner.lands || wins(bidder, winner)) winner = bidder;
  }

  testing::HostMaps out = maps;
  std::fill(out.disparity.begin() + pixels, out.disparity.end(), EGOSGM_INVALID_DISPARITY);
  std::fill(out.variance.begin() + pixels, out.variance.end(), 0.0f);
  for (std::size_t i = 0; i < pixels; ++i) {
    if (!winners[i].lands) continue;
    const float d =
        static_cast<float>(winners[i].steps) / EGOSGM_RIGHT_MAP_STEPS_PER_PX - 1 + static_cast<float>(min_disparity);
    const float left_x = std::nearbyint(static_cast<float>(i % width) + d);
    if (!(left_x >= 0 && left_x < static_cast<float>(width))) continue;
    const std::size_t left = i / width * width + static_cast<std::size_t>(left_x);
    if (maps.disparity[left] == EGOSGM_INVALID_DISPARITY) continue;
    out.disparity[pixels + i] = d;
    out.variance[pixels + i] = maps.variance[left];
  }
  return out;
}

}  // namespace egosgm::reference
