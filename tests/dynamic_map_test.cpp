// SPDX-License-Identifier: Apache-2.0
#include "host/dynamic_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/compare.h"
#include "tests/support/random_maps.h"

namespace egosgm {
namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

/// The definition, window by window.
std::vector<std::uint8_t> expected_map(shared::ImageSize size, float min_difference_px,
                                       const std::vector<float>& predicted, const std::vector<float>& measured) {
  std::vector<std::uint8_t> marks(predicted.size(), 0);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      int both = 0, different = 0;
      for (int v = y - 4; v <= y + 4; ++v) {
        for (int u = x - 4; u <= x + 4; ++u) {
          if (v < 0 || v >= size.height || u < 0 || u >= size.width) continue;
          const std::size_t i = static_cast<std::size_t>(v) * size.width + u;
          if (predicted[i] == kNone || measured[i] == kNone) continue;
          ++both;
          different += std::abs(predicted[i] - measured[i]) > min_difference_px;
        }
      }
      const std::size_t here = static_cast<std::size_t>(y) * size.width + x;
      const bool has_both = predicted[here] != kNone && measured[here] != kNone;
      if (has_both && both >= 27 && 2 * different >= both) marks[here] = 255;
    }
  }
  return marks;
}

TEST(DynamicMap, EqualsItsDefinition) {
  for (const shared::ImageSize size : testing::kSizes) {
    for (const double holes : {0.0, 0.4}) {
      const std::vector<float> predicted = testing::random_maps(size, 0, 3, holes, 21).disparity;
      const std::vector<float> measured = testing::random_maps(size, 0, 3, holes, 22).disparity;
      const auto pixels = static_cast<std::ptrdiff_t>(size.width) * size.height;
      const std::vector<float> left(predicted.begin(), predicted.begin() + pixels);
      const std::vector<float> left_measured(measured.begin(), measured.begin() + pixels);
      EXPECT_TRUE(testing::same_bits(dynamic_map(size, {.min_difference_px = 0.9f}, left, left_measured),
                                     expected_map(size, 0.9f, left, left_measured), size))
          << size.width << "x" << size.height << ", " << holes;
    }
  }
}

TEST(DynamicMap, MarksAnObjectAndNotSingleMismatches) {
  const shared::ImageSize size{60, 40};
  std::vector<float> predicted(60 * 40, 10.0f), measured = predicted;
  const auto set = [&](int x, int y, float d) { measured[static_cast<std::size_t>(y) * 60 + x] = d; };
  for (int y = 10; y < 30; ++y) {
    for (int x = 20; x < 40; ++x) set(x, y, 12);
  }
  set(5, 5, 90);
  set(30, 20, kNone);
  const std::vector<std::uint8_t> marks = dynamic_map(size, {.min_difference_px = 1}, predicted, measured);
  const auto mark = [&](int x, int y) { return marks[static_cast<std::size_t>(y) * 60 + x]; };
  EXPECT_EQ(mark(25, 15), 255);
  EXPECT_EQ(mark(20, 20), 255);
  EXPECT_EQ(mark(30, 20), 0) << "nothing was measured here";
  EXPECT_EQ(mark(5, 5), 0);
  EXPECT_EQ(mark(50, 20), 0);
}

}  // namespace
}  // namespace egosgm
