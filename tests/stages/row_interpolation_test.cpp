// SPDX-License-Identifier: Apache-2.0
#include "host/stages/row_interpolation.h"

#include <gtest/gtest.h>

#include "tests/reference/row_interpolation.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;

testing::HostMaps interpolate(shared::ImageSize size, int step, const testing::HostMaps& maps, int pixels = 0) {
  ocl::Context& context = testing::shared_context();
  RowInterpolation stage(context, size, pixels);
  StereoMaps on_device = testing::upload(context, size, maps);
  stage.interpolate(on_device.disparity, on_device.variance, {2, step});
  return {on_device.disparity.read(context), on_device.variance.read(context)};
}

EGOSGM_TEST_AT_ALL_SIZES(RowInterpolationTest);

TEST_P(RowInterpolationTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  const testing::HostMaps maps = testing::random_maps(size, 0, 12, 0.2, 51);
  for (const int step : {1, 2, 3}) {
    const testing::HostMaps expected = testing::masked(reference::row_interpolation(size, step, maps));
    for (const int pixels : {1, 16}) {
      EXPECT_TRUE(testing::same_maps(testing::masked(interpolate(size, step, maps, pixels)), expected, size))
          << "by " << pixels << ", row step " << step;
    }
  }
}

// Both views are a column; the left one is the same everywhere.
TEST(RowInterpolation, TakesTheMeanOfTwoRowsOrTheOnlyOne) {
  const std::vector<float> left(8, 9.0f), variances{2, 2, 2, 2, 2, 2, 2, 2, 1, 8, 3, 8, 2, 8, 5, 8};
  testing::HostMaps maps{left, variances};
  for (const float d : {4.0f, 0.0f, 7.0f, 0.0f, 10.5f, 0.0f, kNone, 0.0f}) maps.disparity.push_back(d);
  const testing::HostMaps out = interpolate({1, 8}, 2, maps);
  EXPECT_EQ(out.disparity, (std::vector<float>{9, 9, 9, 9, 9, 9, 9, 9, 4, 5.5f, 7, kNone, 10.5f, 10.5f, kNone, kNone}));
  EXPECT_EQ(out.variance[11], 0) << "of no disparity";
  EXPECT_EQ(testing::masked(out).variance, (std::vector<float>{2, 2, 2, 2, 2, 2, 2, 2, 1, 2, 3, 0, 2, 2, 0, 0}));
}

}  // namespace
}  // namespace egosgm
