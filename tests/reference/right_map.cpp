// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/right_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

/// The nearest surface that lands on each right pixel, in steps of a key; none: kNone.
std::vector<float> landed(shared::ImageSize size, int min_disparity, const testing::HostMaps& maps) {
  const std::size_t width = size.width;
  std::vector<float> nearest(width * size.height, kNone);
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    const float d = maps.disparity[i], right_x = std::nearbyint(static_cast<float>(i % width) - d);
    if (d == kNone || !(right_x >= 0 && right_x < static_cast<float>(width))) continue;
    const float steps = (d - static_cast<float>(min_disparity) + 1) * kRightMapStepsPerPx;
    const float whole = static_cast<float>(static_cast<std::uint32_t>(steps));
    float& there = nearest[i / width * width + static_cast<std::size_t>(right_x)];
    there = std::max(there, whole / kRightMapStepsPerPx - 1 + static_cast<float>(min_disparity));
  }
  return nearest;
}

}  // namespace

testing::HostMaps right_map(shared::ImageSize size, int min_disparity, float max_difference_px,
                            const testing::HostMaps& measured, const testing::HostMaps& maps) {
  const std::size_t width = size.width, pixels = width * size.height;
  const std::vector<float> nearest = landed(size, min_disparity, maps);
  testing::HostMaps out = maps;
  if (!out.hidden.empty()) std::fill(out.hidden.begin() + static_cast<std::ptrdiff_t>(pixels), out.hidden.end(), 0);
  for (std::size_t i = 0; i < pixels; ++i) {
    const float z = measured.disparity[pixels + i], d = z > kNone ? z : nearest[i];
    out.disparity[pixels + i] = z > kNone ? z : kNone;
    out.variance[pixels + i] = z > kNone ? measured.variance[pixels + i] : 0.0f;
    const float left_x = std::nearbyint(static_cast<float>(i % width) + d);
    if (d == kNone || !(left_x >= 0 && left_x < static_cast<float>(width))) continue;
    const std::size_t left = i / width * width + static_cast<std::size_t>(left_x);
    if (maps.disparity[left] == kNone || !(std::abs(maps.disparity[left] - d) <= max_difference_px)) continue;
    out.disparity[pixels + i] = maps.disparity[left];
    out.variance[pixels + i] = maps.variance[left];
  }
  return out;
}

}  // namespace egosgm::reference
