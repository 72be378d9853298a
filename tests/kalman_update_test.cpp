// SPDX-License-Identifier: Apache-2.0
#include "host/kalman_update.h"

#include <gtest/gtest.h>

#include "tests/reference/kalman_update.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm {
namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

testing::HostMaps update(shared::ImageSize size, const KalmanUpdateOptions& options, const testing::HostMaps& predicted,
                         const testing::HostMaps& measured, int pixels = 0) {
  ocl::Context context(testing::any_device());
  KalmanUpdate update(context, size, options, pixels);
  const StereoMaps prediction = testing::upload(context, size, predicted);
  const StereoMaps measurement = testing::upload(context, size, measured);
  StereoMaps out = testing::upload(context, size, testing::random_maps(size, 0, 9, 0.5, 99));  // must not shine through
  update(prediction, measurement, out);
  return testing::download(context, out);
}

struct Estimate {
  float disparity, variance;
  bool operator==(const Estimate&) const = default;
};

constexpr Estimate kNothing{kNone, 0};

Estimate update_pixel(const KalmanUpdateOptions& options, Estimate predicted, Estimate measured) {
  const testing::HostMaps updated = update({1, 1}, options, {{predicted.disparity, kNone}, {predicted.variance, 0}},
                                           {{measured.disparity, kNone}, {measured.variance, 0}});
  EXPECT_EQ(updated.disparity[1], kNone);
  EXPECT_EQ(updated.variance[1], 0);
  return {updated.disparity[0], updated.variance[0]};
}

class KalmanUpdateTest : public ::testing::TestWithParam<shared::ImageSize> {};

TEST_P(KalmanUpdateTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  const testing::HostMaps predicted = testing::random_maps(size, -20, 20, 0.3, 6);
  testing::HostMaps measured = testing::random_maps(size, -3, 3, 0.3, 7);
  for (std::size_t i = 0; i < measured.disparity.size(); ++i) {
    const bool both = measured.disparity[i] != kNone && predicted.disparity[i] != kNone;
    if (both) measured.disparity[i] += predicted.disparity[i];
  }
  for (const KalmanUpdateOptions& options :
       {KalmanUpdateOptions{}, KalmanUpdateOptions{.gate_px = 0, .keep_predicted = false, .min_variance_px2 = 0.5f}}) {
    const testing::HostMaps expected = reference::kalman_update(options.gate_px, options.keep_predicted,
                                                                options.min_variance_px2, predicted, measured);
    for (const int pixels : {1, 16}) {
      const testing::HostMaps actual = update(size, options, predicted, measured, pixels);
      EXPECT_TRUE(testing::same_bits(actual.disparity, expected.disparity, size))
          << "gate " << options.gate_px << ", by " << pixels;
      EXPECT_TRUE(testing::same_bits(actual.variance, expected.variance, size))
          << "gate " << options.gate_px << ", by " << pixels;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sizes, KalmanUpdateTest, ::testing::ValuesIn(testing::kSizes), testing::size_name);

TEST(KalmanUpdate, WeighsByTheVariances) {
  EXPECT_EQ(update_pixel({}, {10, 1}, {12, 1}), (Estimate{11, 0.5f}));
  EXPECT_EQ(update_pixel({}, {10, 3}, {12, 1}), (Estimate{11.5f, 0.75f}));
  EXPECT_EQ(update_pixel({}, {10, 1}, {12, 3}), (Estimate{10.5f, 0.75f}));
}

TEST(KalmanUpdate, TakesTheMeasurementBeyondTheGate) {
  EXPECT_EQ(update_pixel({.gate_px = 2}, {10, 1}, {12, 1}), (Estimate{11, 0.5f}));
  // With a variance for which the next frame searches wide.
  const float wide = EGOSGM_ESCAPED_VARIANCE_PX2;
  EXPECT_EQ(update_pixel({.gate_px = 2}, {10, 1}, {12.25f, 1}), (Estimate{12.25f, wide}));
  EXPECT_EQ(update_pixel({.gate_px = 2}, {10, 1}, {7.75f, 1}), (Estimate{7.75f, wide}));
  EXPECT_EQ(update_pixel({.gate_px = 2}, {10, 1}, {7.75f, 2 * wide}), (Estimate{7.75f, 2 * wide}));
  EXPECT_EQ(update_pixel({.gate_px = 0}, {10, 1}, {90, 1}), (Estimate{50, 0.5f}));
}

TEST(KalmanUpdate, TakesAMeasurementThatEscapedItsBand) {
  const float escaped = EGOSGM_ESCAPED_VARIANCE_PX2;
  EXPECT_EQ(update_pixel({.gate_px = 2}, {10, 1}, {11, escaped}), (Estimate{11, escaped}));
  EXPECT_EQ(update_pixel({.gate_px = 0}, {10, 1}, {11, escaped}), (Estimate{11, escaped}));
}

TEST(KalmanUpdate, TakesWhatIsThere) {
  EXPECT_EQ(update_pixel({}, kNothing, {12, 3}), (Estimate{12, 3}));
  EXPECT_EQ(update_pixel({.keep_predicted = true}, {10, 5}, kNothing), (Estimate{10, 5}));
  EXPECT_EQ(update_pixel({.keep_predicted = false}, {10, 5}, kNothing), kNothing);
  EXPECT_EQ(update_pixel({}, kNothing, kNothing), kNothing);
}

TEST(KalmanUpdate, NeverClaimsMoreThanTheFloor) {
  const KalmanUpdateOptions options{.min_variance_px2 = 0.25f};
  EXPECT_EQ(update_pixel(options, {10, 0.25f}, {10, 0.25f}), (Estimate{10, 0.25f}));
  EXPECT_EQ(update_pixel(options, kNothing, {12, 0.125f}), (Estimate{12, 0.25f}));
  EXPECT_EQ(update_pixel(options, {10, 0.125f}, kNothing), (Estimate{10, 0.25f}));
  EXPECT_EQ(update_pixel(options, {10, 0}, {11, 0}), (Estimate{10, 0.25f}));
}

}  // namespace
}  // namespace egosgm
