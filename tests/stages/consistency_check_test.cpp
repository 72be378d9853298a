// SPDX-License-Identifier: Apache-2.0
#include "host/stages/consistency_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "tests/reference/consistency_check.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;

testing::HostMaps check(shared::ImageSize size, float max_difference_px, const testing::HostMaps& maps,
                        OutsideView outside = OutsideView::kDrop, int pixels = 0, Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  ConsistencyCheck stage(context, size, pixels);
  Map kept = testing::upload(context, size, testing::earlier_maps(size)).disparity;
  stage.check(testing::upload(context, size, maps).disparity, max_difference_px, outside, kept, views);
  return {kept.read(context), {}};
}

// A row of both views.
std::vector<float> check_row(const std::vector<float>& left, const std::vector<float>& right, float max_difference_px,
                             OutsideView outside = OutsideView::kDrop) {
  const shared::ImageSize size{static_cast<int>(left.size()), 1};
  testing::HostMaps maps{left, std::vector<float>(2 * left.size(), 1.0f)};
  maps.disparity.insert(maps.disparity.end(), right.begin(), right.end());
  return check(size, max_difference_px, maps, outside).disparity;
}

EGOSGM_TEST_AT_ALL_SIZES(ConsistencyCheckTest);

TEST_P(ConsistencyCheckTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  const testing::HostMaps maps = testing::random_maps(size, -4, 12, 0.2, 5);
  for (const OutsideView outside : {OutsideView::kDrop, OutsideView::kKeep}) {
    for (const float max_px : {0.5f, 3.0f, 40.0f}) {
      SCOPED_TRACE(max_px);
      const bool keeps = outside == OutsideView::kKeep;
      testing::expect_reference(
          size, testing::earlier_maps(size),
          [&](int pixels, Views views) { return check(size, max_px, maps, outside, pixels, views); },
          [&](int step) { return reference::consistency_check(size, max_px, keeps, maps, step); });
    }
  }
}

TEST(ConsistencyCheck, KeepsWhatBothViewsSee) {
  EXPECT_EQ(check_row({kNone, kNone, 2, 2}, {2, 2, kNone, kNone}, 1),
            (std::vector<float>{kNone, kNone, 2, 2, 2, 2, kNone, kNone}));
  EXPECT_EQ(check_row({-1, -1, kNone}, {kNone, -1, -1}, 1), (std::vector<float>{-1, -1, kNone, kNone, -1, -1}));
}

TEST(ConsistencyCheck, DropsWhatLeavesTheImageMeetsAHoleOrDisagrees) {
  // Left 0 points out of the image, left 1 to a hole, left 3 to a right pixel that says 3; that one points to left 5:
  // outside.
  const std::vector<float> left{1, 1, kNone, 1, kNone}, right{kNone, kNone, 3, kNone, kNone};
  EXPECT_EQ(check_row(left, right, 1.5f), (std::vector<float>(10, kNone)));
  EXPECT_EQ(check_row(left, right, 1.5f, OutsideView::kKeep),
            (std::vector<float>{1, kNone, kNone, kNone, kNone, kNone, kNone, 3, kNone, kNone}));
}

TEST(ConsistencyCheck, ToleratesADifferenceUpToTheLimit) {
  const std::vector<float> left{kNone, 1.25f}, right{0.75f, kNone};
  EXPECT_EQ(check_row(left, right, 0.5f), (std::vector<float>{kNone, 1.25f, 0.75f, kNone}));
  EXPECT_EQ(check_row(left, right, 0.4375f), (std::vector<float>(4, kNone)));
}

TEST(ConsistencyCheck, ChecksEachViewAgainstTheOtherAsItCame) {
  // Left 3 agrees with right 1, whose own match, left 4, does not agree with it: right 1 goes, left 3 stays.
  EXPECT_EQ(check_row({kNone, kNone, kNone, 2, 9}, {kNone, 3, kNone, kNone, kNone}, 1.5f),
            (std::vector<float>{kNone, kNone, kNone, 2, kNone, kNone, kNone, kNone, kNone, kNone}));
}

TEST(ConsistencyCheck, RoundsToTheNearestEvenPixel) {
  // x = 3, d = 0.5: 2.5 rounds to 2. x = 4, d = 0.5: 3.5 rounds to 4.
  const std::vector<float> checked =
      check_row({kNone, kNone, kNone, 0.5f, 0.5f}, {kNone, kNone, 0.5f, 20, 0.5f}, 0.25f);
  EXPECT_EQ(checked[3], 0.5f);
  EXPECT_EQ(checked[4], 0.5f);
}

}  // namespace
}  // namespace egosgm
