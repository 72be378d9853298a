// SPDX-License-Identifier: Apache-2.0
#include "host/dynamic_map.h"

#include <algorithm>
#include <cmath>

namespace egosgm {
namespace {

constexpr int kRadius = 4;
constexpr int kMinBoth = (2 * kRadius + 1) * (2 * kRadius + 1) / 3;

/// Of a column or a window: pixels with prediction and measurement, and those of them where the two differ.
struct Counts {
  int both = 0, different = 0;
  void add(const Counts& other, int sign) {
    both += sign * other.both;
    different += sign * other.different;
  }
};

}  // namespace

std::vector<std::uint8_t> dynamic_map(shared::ImageSize size, const DynamicMapOptions& options,
                                      const std::vector<float>& predicted, const std::vector<float>& measured) {
  const auto counts_at = [&](int x, int y) -> Counts {
    const std::size_t i = static_cast<std::size_t>(y) * size.width + x;
    if (predicted[i] == EGOSGM_INVALID_DISPARITY || measured[i] == EGOSGM_INVALID_DISPARITY) return {};
    return {1, std::abs(measured[i] - predicted[i]) > options.min_difference_px};
  };
  std::vector<std::uint8_t> marks(static_cast<std::size_t>(size.width) * size.height, 0);
  std::vector<Counts> columns(size.width);  // of the rows around y
  const auto add_row = [&](int y, int sign) {
    for (int x = 0; y >= 0 && y < size.height && x < size.width; ++x) columns[x].add(counts_at(x, y), sign);
  };
  for (int y = 0; y < kRadius; ++y) add_row(y, 1);
  for (int y = 0; y < size.height; ++y) {
    add_row(y + kRadius, 1);
    add_row(y - kRadius - 1, -1);
    Counts window;
    for (int x = 0; x < std::min(kRadius, size.width); ++x) window.add(columns[x], 1);
    for (int x = 0; x < size.width; ++x) {
      if (x + kRadius < size.width) window.add(columns[x + kRadius], 1);
      if (x - kRadius - 1 >= 0) window.add(columns[x - kRadius - 1], -1);
      const bool is_dynamic = window.both >= kMinBoth && 2 * window.different >= window.both;
      if (is_dynamic && counts_at(x, y).both) marks[static_cast<std::size_t>(y) * size.width + x] = 255;
    }
  }
  return marks;
}

}  // namespace egosgm
