// SPDX-License-Identifier: Apache-2.0
#include "host/stages/dynamic_map.h"

#include <gtest/gtest.h>

#include "tests/reference/dynamic_map.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm {
namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

std::vector<cl_uchar> marks_of(shared::ImageSize size, const testing::HostMaps& predicted,
                               const testing::HostMaps& measured, int pixels = 0) {
  ocl::Context context(testing::any_device());
  DynamicMap dynamic_map(context, size, pixels);
  const StereoMaps first = testing::upload(context, size, predicted), second = testing::upload(context, size, measured);
  ocl::Buffer<cl_uchar> marks(context, pixel_count(size));
  marks.write(context, std::vector<cl_uchar>(pixel_count(size), 99));  // must not shine through
  dynamic_map.mark(first.disparity, second.disparity, marks);
  return marks.read(context);
}

EGOSGM_TEST_AT_ALL_SIZES(DynamicMapTest);

TEST_P(DynamicMapTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const double holes : {0.0, 0.4}) {
    const testing::HostMaps predicted = testing::random_maps(size, 0, 3, holes, 21);
    const testing::HostMaps measured = testing::random_maps(size, 0, 3, holes, 22);
    const std::vector<std::uint8_t> expected = reference::dynamic_map(size, predicted, measured);
    for (const int pixels : {1, 16}) {
      EXPECT_TRUE(testing::same_bits(marks_of(size, predicted, measured, pixels), expected, size))
          << holes << " holes, by " << pixels;
    }
  }
}

TEST(DynamicMap, MarksAnObjectAndNotSingleMismatches) {
  const shared::ImageSize size{60, 40};
  const testing::HostMaps predicted{std::vector(2 * 60 * 40, 10.0f), std::vector(2 * 60 * 40, 1.0f)};
  testing::HostMaps measured = predicted;
  const auto set = [&](int x, int y, float d) { measured.disparity[static_cast<std::size_t>(y) * 60 + x] = d; };
  for (int y = 10; y < 30; ++y) {
    for (int x = 20; x < 40; ++x) set(x, y, 12);
  }
  set(5, 5, 90);
  set(30, 20, kNone);
  const std::vector<cl_uchar> marks = marks_of(size, predicted, measured);
  const auto mark = [&](int x, int y) { return marks[static_cast<std::size_t>(y) * 60 + x]; };
  EXPECT_EQ(mark(25, 15), 255);
  EXPECT_EQ(mark(20, 20), 255);
  EXPECT_EQ(mark(30, 20), 0) << "nothing was measured here";
  EXPECT_EQ(mark(5, 5), 0);
  EXPECT_EQ(mark(50, 20), 0);
}

}  // namespace
}  // namespace egosgm
