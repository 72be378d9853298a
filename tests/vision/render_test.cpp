// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/render.h"

#include <gtest/gtest.h>

#include <limits>

#include "egosgm/image.h"
#include "egosgm/reason.h"
#include "egosgm/vision/image_io.h"
#include "tests/support/expect_refused.h"
#include "tests/vision/images.h"
#include "vision/picture_sheet.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

constexpr float kNo = kInvalidDisparity;
constexpr Color kBlack{0, 0, 0}, kGrey{128, 128, 128};

TEST(Render, NearIsRedAndFarIsBlueAndInvalidIsBlack) {
  const Image map = map_from(1, {10, 100, kNo, -5, 1000});
  const Image picture = color_disparity(map, {.low = 0, .high = 110});
  ASSERT_EQ(picture.type, kBgr8);
  const auto at = [&](int x) { return picture.at<Color>(0, x); };
  EXPECT_GT(at(0)[0], at(0)[2]);  // blue
  EXPECT_GT(at(1)[2], at(1)[0]);  // red
  EXPECT_EQ(at(2), kBlack);
  EXPECT_NE(at(3), kBlack);  // out of the range: its end's colour
  EXPECT_EQ(at(3), color_disparity(map_from(1, {0}), {.low = 0, .high = 110}).at<Color>(0, 0));
  EXPECT_EQ(at(4), color_disparity(map_from(1, {110}), {.low = 0, .high = 110}).at<Color>(0, 0));
}

TEST(Render, RangeIgnoresOutliers) {
  Image map(100, 100, kF32, 20);
  map.at<float>(5, 5) = 5000;
  map.at<float>(6, 6) = kNo;
  EXPECT_DOUBLE_EQ(disparity_range(map).low, 0);
  EXPECT_DOUBLE_EQ(disparity_range(map).high, 20);
  map.at<float>(7, 7) = -4;
  EXPECT_DOUBLE_EQ(disparity_range(map).low, -4);
  const Image none(3, 3, kF32, kNo);
  EXPECT_LT(disparity_range(none).low, disparity_range(none).high);
  EXPECT_EQ(count_nonzero(color_disparity(none)), 0);
}

TEST(Render, VarianceIsLogarithmicWhereDisparityIs) {
  const Image variance = map_from(1, {0.1f, 1, 1, 0});
  const Image disparity = map_from(1, {5, 5, kNo, 5});
  const Image picture = color_variance(variance, disparity, {.low = 0.01, .high = 10, .logarithmic = true});
  const Image linear = color_map(map_from(1, {1, 2}), {.low = 0, .high = 3});
  EXPECT_EQ(picture.at<Color>(0, 0), linear.at<Color>(0, 0));
  EXPECT_EQ(picture.at<Color>(0, 1), linear.at<Color>(0, 1));
  EXPECT_EQ(picture.at<Color>(0, 2), kBlack);
  EXPECT_NE(picture.at<Color>(0, 3), kBlack);
}

TEST(Render, ErrorsTurnFromBlueToRedAtThreePixels) {
  Image truth(1, 11, kF32, kNo), estimate(1, 11, kF32, kNo);
  truth.at<float>(0, 0) = 10, estimate.at<float>(0, 0) = 12.9f;
  truth.at<float>(0, 4) = 10, estimate.at<float>(0, 4) = 6.9f;
  truth.at<float>(0, 8) = 10;
  const Image picture = color_error(estimate, truth);
  const auto at = [&](int x) { return picture.at<Color>(0, x); };
  EXPECT_GT(at(0)[0], at(0)[2]);
  EXPECT_LT(at(4)[0], at(4)[2]);
  EXPECT_EQ(at(8), kGrey);
  EXPECT_EQ(at(1), at(0));  // drawn 3x3
  EXPECT_EQ(at(3), at(4));
  EXPECT_EQ(at(2), kBlack);
  EXPECT_EQ(at(10), kBlack);
}

TEST(Render, BarsShowTheColorsInUse) {
  const Image bar = color_bar(300, {.low = 0, .high = 128}, "px");
  EXPECT_EQ(bar.size(), (Size{300, 40}));
  const Image ends = color_map(map_from(1, {0, 128}), {.low = 0, .high = 128});
  EXPECT_EQ(bar.at<Color>(5, 0), ends.at<Color>(0, 0));
  EXPECT_EQ(bar.at<Color>(5, 299), ends.at<Color>(0, 1));
  EXPECT_GT(count_nonzero(bar.part(0, 24, 300, 16)), 100);  // text
  EXPECT_EQ(error_bar(500).size(), (Size{500, 40}));
  EXPECT_EQ(error_bar(500).at<Color>(5, 499), kGrey);
  for (int width : {1, 3, 20}) {
    EXPECT_EQ(color_bar(width, {}, "px").cols, width);
    EXPECT_EQ(error_bar(width).cols, width);
  }
}

TEST(Render, EachReasonHasAColorOfItsOwnWhichTheBarNames) {
  Image reasons(1, kReasonCount, kU8);
  for (int i = 0; i < kReasonCount; ++i) reasons.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(i);
  const Image colors = color_reasons(reasons), bar = reason_bar(500);
  EXPECT_EQ(bar.size(), (Size{500, 80}));
  for (int i = 0; i < kReasonCount; ++i) {
    EXPECT_EQ(bar.at<Color>(40 * (i / 5) + 10, 100 * (i % 5) + 50), colors.at<Color>(0, i)) << i;
    for (int other = 0; other < i; ++other) EXPECT_NE(colors.at<Color>(0, i), colors.at<Color>(0, other)) << i;
  }
  reasons.at<std::uint8_t>(0, 3) = kReasonCount;
  EXPECT_THROW(color_reasons(reasons), InvalidArgument);
  EXPECT_THROW(color_reasons(colors), InvalidArgument);
}

TEST(Render, GreyBecomesColor) {
  EXPECT_EQ(color_grey(Image(2, 2, kU8, 77)).at<Color>(1, 1), (Color{77, 77, 77}));
  EXPECT_EQ(color_grey(image_from<std::uint16_t>(1, {2000, 4000})).at<Color>(0, 1), (Color{255, 255, 255}));
  EXPECT_EQ(color_grey(Image(1, 1, kU16, 0)).at<Color>(0, 0), kBlack);
}

TEST(Render, PicturesStandInRowsAndColumns) {
  const Image red = picture_of({100, 50}, {0, 0, 255}), blue = picture_of({80, 30}, {255, 0, 0});
  const Image sheet = compose({{red, "red"}, {blue, ""}, {blue, "blue"}}, 2, 100);
  EXPECT_EQ(sheet.size(), (Size{204, 74 + 4 + 54}));
  EXPECT_EQ(sheet.at<Color>(24, 0), (Color{0, 0, 255}));
  EXPECT_EQ(sheet.at<Color>(0, 104), (Color{255, 0, 0}));
  EXPECT_EQ(sheet.at<Color>(74 + 4 + 24, 0), (Color{255, 0, 0}));
  EXPECT_GT(count_nonzero(sheet.part(0, 0, 100, 24)), 10);  // the caption
  EXPECT_EQ(compose({{red, ""}}, 4, 50).size(), (Size{50, 25}));
}

TEST(Render, DepthIsFxTimesBaselineByDisparity) {
  const Calibration calibration{.fx = 700, .fy = 700, .cx = 0, .cy = 0, .baseline_m = 0.5, .doffs_px = 5};
  const Image depth = depth_from_disparity(map_from(1, {30, kNo, -5, 0}), calibration);
  EXPECT_FLOAT_EQ(depth.at<float>(0, 0), 10);
  EXPECT_EQ(depth.at<float>(0, 1), kNo);
  EXPECT_EQ(depth.at<float>(0, 2), kNo);
  EXPECT_FLOAT_EQ(depth.at<float>(0, 3), 70);
}

TEST(Render, WrongInputIsRefused) {
  const Image map(2, 2, kF32, 1), other(3, 2, kF32, 1), bytes(2, 2, kU8);
  expect_refused([&] { color_disparity(bytes); }, {"float32"});
  expect_refused([&] { color_error(map, other); }, {"same size"});
  expect_refused([&] { color_variance(map, other); }, {"same size"});
  expect_refused([&] { color_map(map, {.low = 3, .high = 3}); }, {"low must be less"});
  expect_refused([&] { color_map(map, {.low = 0, .high = 3, .logarithmic = true}); }, {"positive"});
  expect_refused([&] { color_map(map, {.low = 0, .high = std::numeric_limits<double>::quiet_NaN()}); }, {"finite"});
  expect_refused([&] { color_bar(0, {}, "px"); }, {"width"});
  expect_refused([&] { color_grey(map); }, {"uint8"});
  expect_refused([&] { compose({}, 1, 10); }, {"at least one"});
  expect_refused([&] { compose({{bytes, ""}}, 1, 10); }, {"BGR of uint8"});
  expect_refused([&] { depth_from_disparity(Image(), {}); }, {"float32"});
  expect_refused([&] { depth_from_disparity(map, {}); }, {"calibration: fx"});
}

}  // namespace
}  // namespace egosgm::vision
