// SPDX-License-Identifier: Apache-2.0
#include "host/stages/weighted_median.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/reference/weighted_median.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::HostMaps;
using testing::kNone;

constexpr shared::DisparityRange kRange{-40, 128};

HostMaps filter(shared::ImageSize size, PixelType type, const std::vector<std::uint16_t>& images, const HostMaps& in,
                int pixels = 0, Views views = Views::kBoth, shared::DisparityRange range = kRange) {
  ocl::Context& context = testing::shared_context();
  WeightedMedian stage(context, size, type, range, pixels);
  StereoMaps maps = testing::upload(context, size, in);
  Map filtered = testing::upload(context, size, testing::earlier_maps(size)).disparity;
  stage.filter(testing::images_of(context, images, type).pixels, maps.disparity, filtered, maps.variance, views);
  return testing::masked({filtered.read(context), maps.variance.read(context)});
}

EGOSGM_TEST_AT_ALL_SIZES(WeightedMedianTest);

TEST_P(WeightedMedianTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  ocl::Context& context = testing::shared_context();
  std::mt19937 random(7);
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    // Some 30 of 100 grey values apart: most neighbours vote, some do not. The low byte of 16 bits does not count.
    std::vector<std::uint16_t> greys(2 * pixel_count(size)), images;
    std::generate(greys.begin(), greys.end(), [&] { return static_cast<std::uint16_t>(60 + random() % 100); });
    for (const int grey : greys)
      images.push_back(static_cast<std::uint16_t>(type == PixelType::kU8 ? grey : grey << 8 | (random() & 255)));
    for (const double holes : {0.0, 0.3, 1.0}) {
      SCOPED_TRACE(holes);
      HostMaps maps = testing::random_maps(size, -40, 90, holes, 7);
      for (float& d : maps.disparity) {
        if (random() % 2 == 0 && d != kNone) d = static_cast<float>(random() % 3);  // equal votes, too
      }
      const HostMaps before = testing::masked(
          {testing::earlier_maps(size).disparity, testing::upload(context, size, maps).variance.read(context)});
      testing::expect_reference(
          size, before, [&](int pixels, Views views) { return filter(size, type, images, maps, pixels, views); },
          [&](int step) { return reference::weighted_median(size, kRange, greys, maps, step); });
    }
  }
}

/// A pixel and those on its circle, from above to below; the left view's one, twice.
struct Circle {
  static constexpr shared::ImageSize kSize{9, 9};
  static constexpr std::size_t kVotes[9] = {4, 19, 25, 36, 40, 44, 55, 61, 76};
  std::vector<std::uint16_t> greys = std::vector<std::uint16_t>(2 * 81, 100);
  HostMaps maps{std::vector<float>(2 * 81, kNone), std::vector<float>(2 * 81, 0.25f)};

  explicit Circle(const std::vector<float>& disparities) {
    for (std::size_t i = 0; i < 9; ++i) maps.disparity[kVotes[i]] = maps.disparity[81 + kVotes[i]] = disparities[i];
  }
  float middle(float expected_variance = 0.25f, shared::DisparityRange range = kRange) const {
    const HostMaps found = filter(kSize, PixelType::kU8, greys, maps, 0, Views::kBoth, range);
    EXPECT_EQ(found.variance[40], found.disparity[40] == kNone ? 0.0f : expected_variance);
    EXPECT_EQ(found.disparity[81 + 40], found.disparity[40]);
    return found.disparity[40];
  }
};

TEST(WeightedMedian, TakesTheMiddleOfWhatIsAsBright) {
  Circle circle({9, 8, 7, 6, 1, 2, 3, 4, 5});
  EXPECT_EQ(circle.middle(), 5);
  // The four larger ones lie on something darker: of five votes for 1 to 5, 3 is the middle.
  for (const std::size_t i : {0, 1, 2, 3}) circle.greys[Circle::kVotes[i]] = circle.greys[81 + Circle::kVotes[i]] = 52;
  EXPECT_EQ(circle.middle(), 3);
  // A vote of a quarter of the weight, each: 1 to 5 have 240 of 288, and 3 is where half of that is reached.
  for (const std::size_t i : {0, 1, 2, 3}) circle.greys[Circle::kVotes[i]] = circle.greys[81 + Circle::kVotes[i]] = 136;
  EXPECT_EQ(circle.middle(), 3);
  // Of half of the weight, they have 96 of 336: 1 to 3 have 144, and 4 is the middle.
  for (const std::size_t i : {0, 1, 2, 3}) circle.greys[Circle::kVotes[i]] = circle.greys[81 + Circle::kVotes[i]] = 124;
  EXPECT_EQ(circle.middle(), 4);
}

TEST(WeightedMedian, FillsAHoleForWhichSixVote) {
  EXPECT_EQ(Circle({1, 2, 3, kNone, kNone, kNone, 4, 5, 6}).middle(1.0f), 3);
  EXPECT_EQ(Circle({1, 2, 3, kNone, kNone, kNone, 4, 5, kNone}).middle(1.0f), kNone);
  Circle beside_an_edge({1, 2, 3, kNone, kNone, kNone, 4, 5, 6});
  beside_an_edge.greys[4] = beside_an_edge.greys[81 + 4] = 148;
  EXPECT_EQ(beside_an_edge.middle(), kNone);
}

TEST(WeightedMedian, OrdersTheLongestRange) {
  constexpr shared::DisparityRange kLongest{-16384, 4096};
  Circle circle({-16384, -12289, -15000, -13000, -14000.5f, -14001, -14000, -16000, -12500});
  EXPECT_EQ(circle.middle(0.25f, kLongest), -14000.5f);
}

TEST(WeightedMedian, PrefersThePixelsOwnAmongVotesWithinAStep) {
  EXPECT_EQ(Circle({2, 1.001f, 2, 1.002f, 1.003f, 1.004f, 0, 0, 0}).middle(), 1.003f);
  EXPECT_EQ(Circle({2, 2, 2, 1.002f, 1, 1.001f, 0, 0, 0}).middle(), 1);
}

}  // namespace
}  // namespace egosgm
