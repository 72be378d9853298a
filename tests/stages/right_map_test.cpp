// SPDX-License-Identifier: Apache-2.0
#include "host/stages/right_map.h"

#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "tests/reference/right_map.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;
using Row = std::vector<float>;

testing::HostMaps right_map(shared::ImageSize size, shared::DisparityRange range, float max_difference_px,
                            const testing::HostMaps& measured, const testing::HostMaps& maps, int pixels,
                            bool makes_variance = true) {
  ocl::Context& context = testing::shared_context();
  RightMap right_map(context, size, range, pixels);
  // What an earlier frame had must not shine through.
  StereoMaps earlier = testing::upload(context, size, testing::random_maps(size, 0, 12, 0, 99));
  right_map.complete(testing::upload(context, size, testing::random_maps(size, 0, 12, 0, 99)), 1, earlier, true);
  StereoMaps on_device = testing::upload(context, size, maps);
  right_map.complete(testing::upload(context, size, measured), max_difference_px, on_device, makes_variance);
  return testing::download(context, on_device);
}

// The right row of a left one, by both ways, which agree; a measurement within 1 px does not contradict. Its variances:
// 1 and up in the left view, 100 and up where measured.
testing::HostMaps right_row(const Row& left, const Row& measured, int min_disparity = 0) {
  const int width = static_cast<int>(left.size());
  testing::HostMaps maps{left, {}}, z{Row(left.size(), 7), Row(left.size(), 7)};
  for (int x = 0; x < width; ++x) maps.variance.push_back(1.0f + static_cast<float>(x));
  maps.disparity.resize(2 * left.size(), 5), maps.variance.resize(2 * left.size(), 9);
  z.disparity.insert(z.disparity.end(), measured.begin(), measured.end());
  for (int x = 0; x < width; ++x) z.variance.push_back(100.0f + static_cast<float>(x));
  testing::HostMaps found[2];
  for (const int way : {0, 1}) {
    found[way] = right_map({width, 1}, {min_disparity, 64}, 1, z, maps, way == 0 ? 1 : 16);
    for (Row* values : {&found[way].disparity, &found[way].variance}) {
      values->erase(values->begin(), values->begin() + width);
    }
  }
  EXPECT_EQ(found[0].disparity, found[1].disparity);
  EXPECT_EQ(found[0].variance, found[1].variance);
  return found[0];
}

EGOSGM_TEST_AT_ALL_SIZES(RightMapTest);

TEST_P(RightMapTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  const float max_disparity = size.width > 300 ? 150 : 12;
  testing::HostMaps maps = testing::random_maps(size, -4.5f, max_disparity, 0.2, 5);
  const testing::HostMaps full = testing::random_maps(size, -4.5f, max_disparity, 0, 7);
  maps = testing::left_and_right(maps, full);
  const testing::HostMaps measured = testing::random_maps(size, -4, max_disparity, 0.5, 6);
  for (const float max_difference_px : {0.0f, 1.0f, 1e6f}) {
    const testing::HostMaps expected = reference::right_map(size, -4, max_difference_px, measured, maps);
    for (const int pixels : {1, 16}) {
      const testing::HostMaps actual = right_map(size, {-4, 160}, max_difference_px, measured, maps, pixels);
      const testing::HostMaps bare = right_map(size, {-4, 160}, max_difference_px, measured, maps, pixels, false);
      EXPECT_EQ(bare.disparity, expected.disparity);
      EXPECT_EQ(bare.variance, testing::masked({bare.disparity, maps.variance}).variance);
      EXPECT_TRUE(testing::same_maps(actual, expected, size)) << max_difference_px << " px, by " << pixels;
    }
  }
}

TEST(RightMap, LandsOnTheNearestPixelWithTheVarianceOfItsSource) {
  const testing::HostMaps right = right_row({kNone, kNone, 2, 1.25f, 0.75f, kNone}, Row(6, kNone));
  EXPECT_EQ(right.disparity, (Row{2, kNone, 1.25f, 0.75f, kNone, kNone}));
  EXPECT_EQ(right.variance, (Row{3, 0, 4, 5, 0, 0}));
}

TEST(RightMap, TakesWhatTheMeasuredPixelHasOrTheMeasurement) {
  // Right 2 sees left 3 by a measurement of 1, left 5 by 3.
  const Row left{kNone, kNone, kNone, 1.25f, kNone, 3};
  const auto at_2 = [&](float z) {
    const testing::HostMaps right = right_row(left, {kNone, kNone, z, kNone, kNone, kNone});
    return std::pair(right.disparity[2], right.variance[2]);
  };
  EXPECT_EQ(at_2(kNone), std::pair(3.0f, 6.0f)) << "the nearest";
  EXPECT_EQ(at_2(1), std::pair(1.25f, 4.0f)) << "farther, but measured";
  EXPECT_EQ(at_2(1.25f), std::pair(1.25f, 4.0f));
  EXPECT_EQ(at_2(3), std::pair(3.0f, 6.0f));
  EXPECT_EQ(at_2(2), std::pair(2.0f, 102.0f)) << "of a hole";
  EXPECT_EQ(at_2(3.4f), std::pair(3.0f, 6.0f));
  EXPECT_EQ(at_2(0.6f), std::pair(1.25f, 4.0f));
  EXPECT_EQ(at_2(60), std::pair(60.0f, 102.0f)) << "of a place outside";
}

TEST(RightMap, TakesTheNearestWhicheverComesLast) {
  const Row left{kNone, kNone, kNone, 1, kNone, 3, 3, kNone, 5};  // two on right 2, two on right 3
  EXPECT_EQ(right_row(left, Row(9, kNone)).disparity, (Row{kNone, kNone, 3, 5, kNone, kNone, kNone, kNone, kNone}));
  const Row falling{kNone, 1, 2, kNone, kNone};  // with a negative one behind
  EXPECT_EQ(right_row(falling, Row(5, kNone)).disparity, (Row{2, kNone, kNone, kNone, kNone}));
}

TEST(RightMap, TakesTheLargerOfNeighboursThatRoundingBringsTogether) {
  // 999.5 - 2^-16 is rounded to 999.5, and so comes to 1000 as the farther 1000.5 to its right does.
  constexpr int kWidth = 1024;
  const Row none(2 * kWidth, kNone), variance(2 * kWidth, 1);
  testing::HostMaps maps{none, variance};
  maps.disparity[1004] = 4.5f + 0x1p-16f;
  maps.disparity[1005] = 4.5f;
  for (const int pixels : {1, 16}) {
    const testing::HostMaps found = right_map({kWidth, 1}, {0, 64}, 0, {none, variance}, maps, pixels);
    EXPECT_EQ(found.disparity[kWidth + 1000], 4.5f + 0x1p-16f) << pixels;
  }
}

TEST(RightMap, KnowsNegativeDisparities) {
  EXPECT_EQ(right_row({kNone, -2, kNone, -3.5f, kNone, kNone, kNone, kNone}, Row(8, kNone), -3).disparity,
            (Row{kNone, kNone, kNone, -2, kNone, kNone, kNone, kNone}))
      << "6.5 is nearest to 6, from where 2.5 is nearest to left 2: a hole";
  EXPECT_EQ(right_row({-2, -3, kNone, kNone, kNone}, Row(5, kNone), -3).disparity, (Row{kNone, kNone, -2, kNone, -3}));
  EXPECT_EQ(right_row({kNone, -1, kNone, 1}, Row(4, kNone), -3).disparity, (Row{kNone, kNone, 1, kNone}));
}

TEST(RightMap, DropsWhatLandsOutside) {
  EXPECT_EQ(right_row({1, 2, -1, kNone, -1}, Row(5, kNone), -3).disparity, (Row{kNone, kNone, kNone, -1, kNone}));
}

TEST(RightMap, DropsWhatTheLeftViewDoesNotSeeThere) {
  // Left 3 lands halfway, on right 2, whose 2.5 is nearest to the hole at left 2; left 5 on right 4, whose 5.5 is
  // nearest to a place outside.
  for (const Row& left : {Row{kNone, kNone, kNone, 0.5f}, Row{kNone, kNone, kNone, kNone, kNone, 1.5f}}) {
    const testing::HostMaps right = right_row(left, Row(left.size(), kNone));
    EXPECT_EQ(right.disparity, Row(left.size(), kNone));
    EXPECT_EQ(right.variance, Row(left.size(), 0));
  }
}

TEST(RightMap, DropsWhatIsNoDisparity) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
  EXPECT_EQ(right_row({nan, infinite, -infinite, 1e30f, -3e9f, 3e9f}, Row(6, nan)).disparity, Row(6, kNone));
  EXPECT_EQ(right_row({kNone, 1, 2}, {nan, kNone, nan}).disparity, (Row{2, kNone, kNone})) << "NaN measures nothing";
}

}  // namespace
}  // namespace egosgm
