// SPDX-License-Identifier: Apache-2.0
#include "host/stages/hole_fill.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/reference/hole_fill.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;

testing::HostMaps fill(shared::ImageSize size, float max_difference_px, const testing::HostMaps& maps, int pixels = 0,
                       Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  HoleFill stage(context, size, {.max_difference_px = max_difference_px}, pixels);
  const StereoMaps in = testing::upload(context, size, testing::with_marks(maps));
  StereoMaps out = testing::upload(context, size, testing::earlier_maps(size));
  FlagMap hidden = testing::on_device<cl_uchar>(context, in.disparity.size(), 9);
  stage.fill(in, out, hidden, views);
  testing::HostMaps filled = testing::download(context, out);
  filled.hidden = hidden.read(context);
  return filled;
}

// The left view; the right one is empty.
testing::HostMaps left_view(shared::ImageSize size, const std::vector<float>& disparity,
                            const std::vector<float>& variance, const std::vector<std::uint8_t>& hidden = {}) {
  testing::HostMaps maps = testing::empty_maps(size);
  maps.hidden.assign(maps.disparity.size(), 0);
  std::copy(hidden.begin(), hidden.end(), maps.hidden.begin());
  std::copy(disparity.begin(), disparity.end(), maps.disparity.begin());
  std::copy(variance.begin(), variance.end(), maps.variance.begin());
  return maps;
}

std::vector<float> fill_left(shared::ImageSize size, const std::vector<float>& disparity) {
  std::vector<float> variance;
  for (const float d : disparity) variance.push_back(d == kNone ? 0.0f : 1.0f);
  std::vector<float> filled = fill(size, 1, left_view(size, disparity, variance)).disparity;
  filled.resize(disparity.size());
  return filled;
}

EGOSGM_TEST_AT_ALL_SIZES(HoleFillTest);

TEST_P(HoleFillTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  testing::HostMaps before = testing::earlier_maps(size), maps = testing::random_maps(size, -20, 100, 0.4, 4);
  before.hidden.assign(before.disparity.size(), 9);
  for (std::size_t i = 0; i < maps.variance.size(); ++i) {
    if (maps.disparity[i] != kNone) maps.variance[i] = static_cast<float>(7 + i % 5);
    maps.hidden.push_back(maps.disparity[i] == kNone && i % 3 > 0);
  }
  for (const float max_px : {0.0f, 1.0f, 100.0f}) {
    SCOPED_TRACE(max_px);
    testing::expect_reference(
        size, before, [&](int pixels, Views views) { return fill(size, max_px, maps, pixels, views); },
        [&](int step) { return reference::hole_fill(size, max_px, maps, step); });
  }
}

TEST(HoleFill, FillsAGapWithTheMeanAndTheLargerVariance) {
  for (const shared::ImageSize size : {shared::ImageSize{3, 1}, shared::ImageSize{1, 3}}) {
    const testing::HostMaps filled = fill(size, 1, left_view(size, {10, kNone, 10.5f}, {0.5f, 0, 0.25f}));
    EXPECT_EQ(filled.disparity, (std::vector<float>{10, 10.25f, 10.5f, kNone, kNone, kNone}));
    EXPECT_EQ(filled.variance, (std::vector<float>{0.5f, 0.5f, 0.25f, 0, 0, 0}));
  }
}

TEST(HoleFill, HidesWhatLiesBetweenHiddenPixels) {
  for (const shared::ImageSize size : {shared::ImageSize{5, 1}, shared::ImageSize{1, 5}}) {
    const std::vector<float> none(5, kNone);
    const testing::HostMaps filled =
        fill(size, 1, left_view(size, {kNone, 10, kNone, kNone, kNone}, {0, 1, 0, 0, 0}, {1, 0, 1, 0, 1}));
    EXPECT_EQ(filled.disparity, testing::empty_maps(size).disparity);
    EXPECT_EQ(filled.variance, testing::empty_maps(size).variance);
    EXPECT_EQ(filled.hidden, left_view(size, none, {}, {1, 1, 1, 1, 1}).hidden);
    const std::vector<float> seen{kNone, 10, 10, kNone, kNone};
    const testing::HostMaps kept = fill(size, 1, left_view(size, seen, {0, 1, 1, 0, 0}, {1, 0, 0, 1, 1}));
    EXPECT_EQ(kept.disparity, left_view(size, seen, {}).disparity);
    EXPECT_EQ(kept.hidden, left_view(size, none, {}, {1, 0, 0, 1, 1}).hidden);
  }
}

TEST(HoleFill, SeesWhatShowsThroughAHiddenPixel) {
  for (const shared::ImageSize size : {shared::ImageSize{3, 1}, shared::ImageSize{1, 3}}) {
    const testing::HostMaps filled = fill(size, 1, left_view(size, {10, kNone, 10}, {1, 0, 2}, {0, 1, 0}));
    EXPECT_EQ(filled.disparity, left_view(size, {10, 10, 10}, {}).disparity);
    EXPECT_EQ(filled.hidden, left_view(size, {}, {}).hidden);
  }
}

TEST(HoleFill, LeavesJumpsWideGapsAndBorders) {
  for (const std::vector<float>& line : std::vector<std::vector<float>>{
           {10, kNone, 11, 11, 11}, {10, kNone, kNone, 10, 10}, {kNone, 10, 10, 10, kNone}, {10, 10, 10, 10, 10}}) {
    EXPECT_EQ(fill_left({5, 1}, line), line);
    EXPECT_EQ(fill_left({1, 5}, line), line);
  }
}

// The middle row has no hole with two neighbours of its own; those above and below are filled first, then its column
// is.
TEST(HoleFill, FillsRowsThenColumnsOnTheirResult) {
  EXPECT_EQ(fill_left({3, 3}, {8, kNone, 8,      //
                               9, kNone, kNone,  //
                               8.5f, kNone, 8.5f}),
            (std::vector<float>{8, 8, 8,          //
                                9, 8.25f, 8.25f,  //
                                8.5f, 8.5f, 8.5f}));
}

}  // namespace
}  // namespace egosgm
