// SPDX-License-Identifier: Apache-2.0
#include "host/stages/median_filter.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/reference/median_filter.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;

testing::HostMaps filter(shared::ImageSize size, const testing::HostMaps& in, int pixels = 0,
                         Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  MedianFilter stage(context, size, pixels);
  StereoMaps maps = testing::upload(context, size, in);
  Map filtered = testing::upload(context, size, testing::earlier_maps(size)).disparity;
  stage.filter(maps.disparity, filtered, views);
  return testing::masked({filtered.read(context), maps.variance.read(context)});
}

// The left view's disparities; the right view is the left one, plus 100.
std::vector<float> filter_left(shared::ImageSize size, const std::vector<float>& left) {
  testing::HostMaps maps{left, std::vector<float>(2 * left.size(), 1.0f)};
  for (const float d : left) maps.disparity.push_back(d == kNone ? kNone : d + 100);
  const std::vector<float> both = filter(size, maps).disparity;
  const std::vector<float> filtered(both.begin(), both.begin() + static_cast<std::ptrdiff_t>(left.size()));
  for (std::size_t i = 0; i < left.size(); ++i) {
    EXPECT_EQ(both[left.size() + i], left[i] == kNone ? kNone : filtered[i] + 100) << "right view, pixel " << i;
  }
  return filtered;
}

EGOSGM_TEST_AT_ALL_SIZES(MedianFilterTest);

TEST_P(MedianFilterTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  ocl::Context& context = testing::shared_context();
  for (const double holes : {0.0, 0.3, 1.0}) {
    const testing::HostMaps maps = testing::random_maps(size, -40, 90, holes, 7);
    const testing::HostMaps before = testing::masked(
        {testing::earlier_maps(size).disparity, testing::upload(context, size, maps).variance.read(context)});
    SCOPED_TRACE(holes);
    testing::expect_reference(
        size, before, [&](int pixels, Views views) { return filter(size, maps, pixels, views); },
        [&](int step) { return reference::median_filter(size, maps, step); });
  }
}

TEST(MedianFilter, TakesTheMiddleOfEveryOrder) {
  std::vector<float> window{1, 2, 3, 4, 5, 6, 7, 8, 9};
  std::mt19937 random(3);
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(filter_left({3, 3}, window)[4], 5) << "order " << i;
    std::shuffle(window.begin(), window.end(), random);
  }
}

TEST(MedianFilter, LeavesHolesAndLetsThemVoteForTheCentre) {
  // The centre has four neighbours that say 1 and four holes: with its own vote, 5 wins. One more 1 outvotes it.
  EXPECT_EQ(filter_left({3, 3}, {1, 1, 1, 1, 5, kNone, kNone, kNone, kNone})[4], 5);
  EXPECT_EQ(filter_left({3, 3}, {1, 1, 1, 1, 5, 1, kNone, kNone, kNone})[4], 1);
  EXPECT_EQ(filter_left({3, 3}, {1, 1, 1, 1, kNone, 1, 1, 1, 1})[4], kNone);
}

TEST(MedianFilter, TheBorderVotesForTheCentre) {
  // A corner has three neighbours, an edge five.
  EXPECT_EQ(filter_left({3, 2}, {5, 1, 1, 1, 1, 1}), (std::vector<float>{5, 1, 1, 1, 1, 1}));
  EXPECT_EQ(filter_left({3, 2}, {1, 5, 1, 1, 1, 1}), (std::vector<float>{1, 1, 1, 1, 1, 1}));
}

}  // namespace
}  // namespace egosgm
