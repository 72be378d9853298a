// SPDX-License-Identifier: Apache-2.0
#include "host/edge_variance.h"

#include <gtest/gtest.h>

#include "tests/reference/edge_variance.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm {
namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

testing::HostMaps widen(shared::ImageSize size, const testing::HostMaps& in, float weight, int pixels = 0) {
  ocl::Context context(testing::any_device());
  EdgeVariance edge_variance(context, size, {.weight = weight}, pixels);
  StereoMaps maps = testing::upload(context, size, in);
  StereoMaps scratch = testing::upload(context, size, testing::random_maps(size, 0, 9, 0.5, 99));
  edge_variance(maps, scratch);
  return testing::download(context, maps);
}

class EdgeVarianceTest : public ::testing::TestWithParam<shared::ImageSize> {};

TEST_P(EdgeVarianceTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const double holes : {0.0, 0.3, 0.98}) {
    const testing::HostMaps maps = testing::random_maps(size, -40, 90, holes, 7);
    const testing::HostMaps expected = reference::edge_variance(size, 0.01f, maps);
    for (const int pixels : {1, 16}) {
      const testing::HostMaps actual = widen(size, maps, 0.01f, pixels);
      EXPECT_TRUE(testing::same_bits(actual.disparity, expected.disparity, size)) << holes << " holes, by " << pixels;
      EXPECT_TRUE(testing::same_bits(actual.variance, expected.variance, size)) << holes << " holes, by " << pixels;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, EdgeVarianceTest, ::testing::ValuesIn(testing::kSizes), testing::size_name);

TEST(EdgeVariance, ReachesFourPixelsFromAStep) {
  testing::HostMaps maps{{}, std::vector<float>(2 * 12, 0.25f)};
  for (int view = 0; view < 2; ++view) {
    for (int x = 0; x < 12; ++x) maps.disparity.push_back(x < 6 ? 10.0f : 20.0f);
  }
  maps.disparity[3] = kNone;
  maps.variance[3] = 0;
  const testing::HostMaps out = widen({12, 1}, maps, 0.5f);
  const std::vector<float> left(out.variance.begin(), out.variance.begin() + 12);
  EXPECT_EQ(left, (std::vector<float>{0.25f, 0.25f, 50, 0, 50, 50, 50, 50, 50, 50, 0.25f, 0.25f}));
  EXPECT_EQ(out.disparity, maps.disparity);
}

TEST(EdgeVariance, KeepsALargerVariance) {
  const testing::HostMaps maps{{1, 3, 1, 3}, {9, 0.5f, 9, 0.5f}};
  EXPECT_EQ(widen({2, 1}, maps, 0.25f).variance, (std::vector<float>{9, 1, 9, 1}));
}

TEST(EdgeVariance, DoesNotMixTheViews) {
  // The last row of the left view lies above the first of the right one.
  const testing::HostMaps maps{{5, 5, 90, 90}, {1, 1, 1, 1}};
  EXPECT_EQ(widen({2, 1}, maps, 1).variance, maps.variance);
}

TEST(EdgeVariance, DoesNothingWithoutAWeight) {
  const testing::HostMaps maps = testing::random_maps({65, 3}, 0, 90, 0.1, 11);
  EXPECT_EQ(widen({65, 3}, maps, 0).variance, maps.variance);
}

}  // namespace
}  // namespace egosgm
