// SPDX-License-Identifier: Apache-2.0
#include "host/fuse/prediction_check.h"

#include <gtest/gtest.h>

#include "tests/reference/fuse/prediction_check.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm {

namespace shared {
static bool operator==(const PredictionState& a, const PredictionState& b) {
  return a.counts.predicted == b.counts.predicted && a.counts.both == b.counts.both &&
         a.counts.differing == b.counts.differing && a.is_wrong == b.is_wrong && a.was_wrong == b.was_wrong;
}
static void PrintTo(const PredictionState& s, std::ostream* out) {
  *out << s.counts.predicted << " predicted, " << s.counts.both << " both, " << s.counts.differing << " differing, "
       << (s.is_wrong ? "wrong" : "right") << (s.was_wrong ? ", were wrong" : "");
}
}  // namespace shared

namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

/// `before` null: a frame that begins anew.
shared::PredictionState check(shared::ImageSize size, const shared::PredictionState* before,
                              const testing::HostMaps& warped, const testing::HostMaps& predicted,
                              const testing::HostMaps& measured, int row_group = 0) {
  ocl::Context context(testing::any_device());
  PredictionCheck prediction_check(context, size, {}, row_group);
  PredictionCheck::State last(context, 1), next(context, 1);
  if (before) last.write(context, {*before});
  next.write(context, {{{9, 9, 9}, 9, 9}});  // must not shine through
  if (before) {
    const StereoMaps moved = testing::upload(context, size, warped), kept = testing::upload(context, size, predicted);
    prediction_check(last, moved.disparity, kept.disparity, testing::upload(context, size, measured).disparity, next);
  } else {
    prediction_check.begin(next);
  }
  return next.read(context).front();
}

class PredictionCheckTest : public ::testing::TestWithParam<shared::ImageSize> {};

TEST_P(PredictionCheckTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  for (const float spread : {1.1f, 4.0f}) {
    const testing::HostMaps warped = testing::random_maps(size, 0, spread, 0.4, 30);
    const testing::HostMaps predicted = testing::random_maps(size, 0, spread, 0.3, 31);
    const testing::HostMaps measured = testing::random_maps(size, 0, spread, 0.2, 32);
    for (const shared::PredictionState& before :
         {shared::PredictionState{}, shared::PredictionState{{100, 80, 1}, 0, 1},
          shared::PredictionState{{90, 9, 4}, 1, 0}}) {
      const shared::PredictionState expected =
          reference::check_prediction(size, before, warped.disparity, predicted.disparity, measured.disparity);
      for (const int row_group : {1, 64}) {
        EXPECT_EQ(check(size, &before, warped, predicted, measured, row_group), expected) << "by " << row_group;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, PredictionCheckTest, ::testing::ValuesIn(testing::kSizes), testing::size_name);
INSTANTIATE_TEST_SUITE_P(Large, PredictionCheckTest, ::testing::Values(testing::kLargest), testing::size_name);

/// 100 pixels, of a row that is looked at: `predicted` of them have a prediction of 10, `differing` of these a
/// measurement of 12, and the first `filled` were not warped.
shared::PredictionState after(const shared::PredictionState& before, int predicted, int differing, int filled = 0) {
  const shared::ImageSize size{100, 1};
  testing::HostMaps prediction{std::vector(200, 10.0f), std::vector(200, 1.0f)}, measurement = prediction,
                                                                                 warped = prediction;
  for (int x = predicted; x < 100; ++x) prediction.disparity[x] = kNone;
  for (int x = 0; x < differing; ++x) measurement.disparity[x] = 12;
  for (int x = 0; x < filled; ++x) warped.disparity[x] = kNone;
  return check(size, &before, warped, prediction, measurement);
}

TEST(PredictionCheck, KnowsAGapAndAWrongMotion) {
  const shared::PredictionState usual{{96, 96, 4}, 0, 0};
  EXPECT_FALSE(after(usual, 96, 4).is_wrong);
  EXPECT_FALSE(after(usual, 72, 4).is_wrong);
  EXPECT_TRUE(after(usual, 71, 4).is_wrong);
  EXPECT_FALSE(after(usual, 96, 10).is_wrong);
  EXPECT_TRUE(after(usual, 96, 11).is_wrong);
  EXPECT_FALSE(after({}, 10, 10).is_wrong) << "nothing to compare with";
}

TEST(PredictionCheck, CountsNoContradictionOfWhatOnlyFillsAGap) {
  const shared::PredictionState usual{{96, 96, 4}, 0, 0};
  EXPECT_EQ(after(usual, 96, 40, 38), (shared::PredictionState{{96, 58, 2}, 0, 0}));
}

TEST(PredictionCheck, RemembersThatTheLastOnesWereWrong) {
  const shared::PredictionState wrong{{96, 96, 40}, 1, 0};
  EXPECT_EQ(after(wrong, 96, 4), (shared::PredictionState{{96, 96, 4}, 0, 1}));
  const testing::HostMaps maps{std::vector(200, 10.0f), std::vector(200, 1.0f)};
  EXPECT_EQ(check({100, 1}, nullptr, maps, maps, maps), (shared::PredictionState{})) << "a frame without predictions";
}

}  // namespace
}  // namespace egosgm
