// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/render.h"

#include <gtest/gtest.h>

#include <limits>

#include "egosgm/image.h"
#include "egosgm/reason.h"
#include "tests/support/expect_refused.h"
#include "vision/picture_sheet.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

constexpr float kNo = kInvalidDisparity;
const cv::Vec3b kBlack(0, 0, 0), kGrey(128, 128, 128);

TEST(Render, NearIsRedAndFarIsBlueAndInvalidIsBlack) {
  const cv::Mat map = (cv::Mat_<float>(1, 5) << 10, 100, kNo, -5, 1000);
  const cv::Mat picture = color_disparity(map, {.low = 0, .high = 110});
  ASSERT_EQ(picture.type(), CV_8UC3);
  const auto at = [&](int x) { return picture.at<cv::Vec3b>(0, x); };
  EXPECT_GT(at(0)[0], at(0)[2]);  // blue
  EXPECT_GT(at(1)[2], at(1)[0]);  // red
  EXPECT_EQ(at(2), kBlack);
  EXPECT_NE(at(3), kBlack);  // out of the range: its end's colour
  EXPECT_EQ(at(3), color_disparity((cv::Mat_<float>(1, 1) << 0), {.low = 0, .high = 110}).at<cv::Vec3b>(0, 0));
  EXPECT_EQ(at(4), color_disparity((cv::Mat_<float>(1, 1) << 110), {.low = 0, .high = 110}).at<cv::Vec3b>(0, 0));
}

TEST(Render, RangeIgnoresOutliers) {
  cv::Mat map(100, 100, CV_32FC1, cv::Scalar(20));
  map.at<float>(5, 5) = 5000;
  map.at<float>(6, 6) = kNo;
  EXPECT_DOUBLE_EQ(disparity_range(map).low, 0);
  EXPECT_DOUBLE_EQ(disparity_range(map).high, 20);
  map.at<float>(7, 7) = -4;
  EXPECT_DOUBLE_EQ(disparity_range(map).low, -4);
  const cv::Mat none(3, 3, CV_32FC1, cv::Scalar(kNo));
  EXPECT_LT(disparity_range(none).low, disparity_range(none).high);
  EXPECT_EQ(cv::countNonZero(color_disparity(none).reshape(1)), 0);
}

TEST(Render, VarianceIsLogarithmicWhereDisparityIs) {
  const cv::Mat variance = (cv::Mat_<float>(1, 4) << 0.1f, 1, 1, 0);
  const cv::Mat disparity = (cv::Mat_<float>(1, 4) << 5, 5, kNo, 5);
  const cv::Mat picture = color_variance(variance, disparity, {.low = 0.01, .high = 10, .logarithmic = true});
  const cv::Mat linear = color_map((cv::Mat_<float>(1, 2) << 1, 2), {.low = 0, .high = 3});
  EXPECT_EQ(picture.at<cv::Vec3b>(0, 0), linear.at<cv::Vec3b>(0, 0));
  EXPECT_EQ(picture.at<cv::Vec3b>(0, 1), linear.at<cv::Vec3b>(0, 1));
  EXPECT_EQ(picture.at<cv::Vec3b>(0, 2), kBlack);
  EXPECT_NE(picture.at<cv::Vec3b>(0, 3), kBlack);
}

TEST(Render, ErrorsTurnFromBlueToRedAtThreePixels) {
  cv::Mat truth(1, 11, CV_32FC1, cv::Scalar(kNo)), estimate(1, 11, CV_32FC1, cv::Scalar(kNo));
  truth.at<float>(0, 0) = 10, estimate.at<float>(0, 0) = 12.9f;
  truth.at<float>(0, 4) = 10, estimate.at<float>(0, 4) = 6.9f;
  truth.at<float>(0, 8) = 10;
  const cv::Mat picture = color_error(estimate, truth);
  const auto at = [&](int x) { return picture.at<cv::Vec3b>(0, x); };
  EXPECT_GT(at(0)[0], at(0)[2]);
  EXPECT_LT(at(4)[0], at(4)[2]);
  EXPECT_EQ(at(8), kGrey);
  EXPECT_EQ(at(1), at(0));  // drawn 3x3
  EXPECT_EQ(at(3), at(4));
  EXPECT_EQ(at(2), kBlack);
  EXPECT_EQ(at(10), kBlack);
}

TEST(Render, BarsShowTheColorsInUse) {
  const cv::Mat bar = color_bar(300, {.low = 0, .high = 128}, "px");
  EXPECT_EQ(bar.size(), cv::Size(300, 40));
  const cv::Mat ends = color_map((cv::Mat_<float>(1, 2) << 0, 128), {.low = 0, .high = 128});
  EXPECT_EQ(bar.at<cv::Vec3b>(5, 0), ends.at<cv::Vec3b>(0, 0));
  EXPECT_EQ(bar.at<cv::Vec3b>(5, 299), ends.at<cv::Vec3b>(0, 1));
  EXPECT_GT(cv::countNonZero(bar.rowRange(24, 40).reshape(1)), 100);  // text
  EXPECT_EQ(error_bar(500).size(), cv::Size(500, 40));
  EXPECT_EQ(error_bar(500).at<cv::Vec3b>(5, 499), kGrey);
  for (int width : {1, 3, 20}) {
    EXPECT_EQ(color_bar(width, {}, "px").cols, width);
    EXPECT_EQ(error_bar(width).cols, width);
  }
}

TEST(Render, EachReasonHasAColorOfItsOwnWhichTheBarNames) {
  cv::Mat reasons(1, kReasonCount, CV_8UC1);
  for (int i = 0; i < kReasonCount; ++i) reasons.at<std::uint8_t>(i) = static_cast<std::uint8_t>(i);
  const cv::Mat colors = color_reasons(reasons), bar = reason_bar(500);
  EXPECT_EQ(bar.size(), cv::Size(500, 80));
  for (int i = 0; i < kReasonCount; ++i) {
    EXPECT_EQ(bar.at<cv::Vec3b>(40 * (i / 5) + 10, 100 * (i % 5) + 50), colors.at<cv::Vec3b>(i)) << i;
    for (int other = 0; other < i; ++other) EXPECT_NE(colors.at<cv::Vec3b>(i), colors.at<cv::Vec3b>(other)) << i;
  }
  reasons.at<std::uint8_t>(3) = kReasonCount;
  EXPECT_THROW(color_reasons(reasons), InvalidArgument);
  EXPECT_THROW(color_reasons(colors), InvalidArgument);
}

TEST(Render, GreyBecomesColor) {
  EXPECT_EQ(color_grey(cv::Mat(2, 2, CV_8UC1, cv::Scalar(77))).at<cv::Vec3b>(1, 1), cv::Vec3b(77, 77, 77));
  EXPECT_EQ(color_grey((cv::Mat_<std::uint16_t>(1, 2) << 2000, 4000)).at<cv::Vec3b>(0, 1), cv::Vec3b(255, 255, 255));
  EXPECT_EQ(color_grey(cv::Mat(1, 1, CV_16UC1, cv::Scalar(0))).at<cv::Vec3b>(0, 0), kBlack);
}

TEST(Render, PicturesStandInRowsAndColumns) {
  const cv::Mat red(50, 100, CV_8UC3, cv::Scalar(0, 0, 255)), blue(30, 80, CV_8UC3, cv::Scalar(255, 0, 0));
  const cv::Mat sheet = compose({{red, "red"}, {blue, ""}, {blue, "blue"}}, 2, 100);
  EXPECT_EQ(sheet.size(), cv::Size(204, 74 + 4 + 54));
  EXPECT_EQ(sheet.at<cv::Vec3b>(24, 0), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(sheet.at<cv::Vec3b>(0, 104), cv::Vec3b(255, 0, 0));
  EXPECT_EQ(sheet.at<cv::Vec3b>(74 + 4 + 24, 0), cv::Vec3b(255, 0, 0));
  EXPECT_GT(cv::countNonZero(sheet(cv::Rect(0, 0, 100, 24)).clone().reshape(1)), 10);  // the caption
  EXPECT_EQ(compose({{red, ""}}, 4, 50).size(), cv::Size(50, 25));
}

TEST(Render, DepthIsFxTimesBaselineByDisparity) {
  const Calibration calibration{.fx = 700, .fy = 700, .cx = 0, .cy = 0, .baseline_m = 0.5, .doffs_px = 5};
  const cv::Mat depth = depth_from_disparity((cv::Mat_<float>(1, 4) << 30, kNo, -5, 0), calibration);
  EXPECT_FLOAT_EQ(depth.at<float>(0, 0), 10);
  EXPECT_EQ(depth.at<float>(0, 1), kNo);
  EXPECT_EQ(depth.at<float>(0, 2), kNo);
  EXPECT_FLOAT_EQ(depth.at<float>(0, 3), 70);
}

TEST(Render, WrongInputIsRefused) {
  const cv::Mat map(2, 2, CV_32FC1, cv::Scalar(1)), other(3, 2, CV_32FC1, cv::Scalar(1)), bytes(2, 2, CV_8UC1);
  expect_refused([&] { color_disparity(bytes); }, {"CV_32FC1"});
  expect_refused([&] { color_error(map, other); }, {"same size"});
  expect_refused([&] { color_variance(map, other); }, {"same size"});
  expect_refused([&] { color_map(map, {.low = 3, .high = 3}); }, {"low must be less"});
  expect_refused([&] { color_map(map, {.low = 0, .high = 3, .logarithmic = true}); }, {"positive"});
  expect_refused([&] { color_map(map, {.low = 0, .high = std::numeric_limits<double>::quiet_NaN()}); }, {"finite"});
  expect_refused([&] { color_bar(0, {}, "px"); }, {"width"});
  expect_refused([&] { color_grey(map); }, {"CV_8UC1"});
  expect_refused([&] { compose({}, 1, 10); }, {"at least one"});
  expect_refused([&] { compose({{bytes, ""}}, 1, 10); }, {"CV_8UC3"});
  expect_refused([&] { depth_from_disparity(cv::Mat(), {}); }, {"CV_32FC1"});
  expect_refused([&] { depth_from_disparity(map, {}); }, {"calibration: fx"});
}

}  // namespace
}  // namespace egosgm::vision
