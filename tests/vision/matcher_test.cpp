// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/matcher.h"

#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/opencv.h"
#include "egosgm/vision/synthetic.h"
#include "tests/support/expect_refused.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

/// A frame of the street as callers of OpenCV have it.
struct Pair {
  explicit Pair(const SyntheticFrame& frame) : left(mat_of(frame.left).clone()), right(mat_of(frame.right).clone()) {}

  cv::Mat left, right;
};

SyntheticSequence street() { return SyntheticSequence({.frames = 2, .width = 160, .height = 64, .seed = 7}); }

PipelineOptions few() {
  PipelineOptions options;
  options.disparities = 48;
  options.paths = 4;
  return options;
}

/// As a caller of either has it.
template <typename Any>
cv::Mat disparity_by(Any& matcher, const cv::Mat& left, const cv::Mat& right) {
  cv::Mat disparity;
  matcher.compute(left, right, disparity);
  return disparity;
}

TEST(Matcher, IsCalledAsOpenCvsAndMeansTheSame) {
  const Pair frame(street().render(0));
  Matcher ours(few());
  const cv::Mat found = disparity_by(ours, frame.left, frame.right);
  const auto theirs = cv::StereoSGBM::create(0, 48, 5);
  const cv::Mat expected = disparity_by(*theirs, frame.left, frame.right);
  ASSERT_EQ(found.type(), expected.type());
  ASSERT_EQ(found.size(), expected.size());
  const cv::Mat none = found == -16;  // theirs, too
  int both = 0, close = 0;
  for (int y = 0; y < found.rows; ++y) {
    for (int x = 0; x < found.cols; ++x) {
      if (none.at<uchar>(y, x) || expected.at<short>(y, x) < 0) continue;
      ++both;
      close += std::abs(found.at<short>(y, x) - expected.at<short>(y, x)) <= 16;
    }
  }
  EXPECT_GT(both, found.rows * found.cols / 3);
  EXPECT_GT(close, both * 8 / 10);
}

TEST(Matcher, IsAStereoMatcherWhoseOptionsHaveOpenCvsNames) {
  EXPECT_EQ(Matcher().options().paths, 8);
  const cv::Ptr<cv::StereoMatcher> matcher = cv::makePtr<Matcher>(few());
  const auto& options = matcher.dynamicCast<Matcher>()->options();
  const Pair frame(street().render(0));
  const cv::Mat before = disparity_by(*matcher, frame.left, frame.right);
  EXPECT_EQ(matcher->getNumDisparities(), 48);
  matcher->setNumDisparities(matcher->getNumDisparities() - 8);
  matcher->setMinDisparity(-3);
  matcher->setSpeckleWindowSize(9);
  matcher->setDisp12MaxDiff(2);
  EXPECT_EQ(options.disparities, 40);
  EXPECT_EQ(options.min_disparity, matcher->getMinDisparity());
  EXPECT_EQ(options.min_disparity, -3);
  EXPECT_EQ(options.max_speckle_px, matcher->getSpeckleWindowSize());
  EXPECT_EQ(options.max_speckle_px, 9);
  EXPECT_EQ(options.left_right_px, matcher->getDisp12MaxDiff());
  EXPECT_EQ(options.left_right_px, 2);
  Matcher made_so(options);
  const cv::Mat after = disparity_by(*matcher, frame.left, frame.right);
  EXPECT_EQ(cv::countNonZero(after != disparity_by(made_so, frame.left, frame.right)), 0);
  EXPECT_NE(cv::countNonZero(after != before), 0);
  matcher->setDisp12MaxDiff(0);
  matcher->setNumDisparities(4096 / 4);
  EXPECT_GE(matcher->getDisp12MaxDiff(), matcher->getNumDisparities());  // any difference, whatever the range becomes
}

TEST(Matcher, SettersThatRefuseChangeNothing) {
  Matcher matcher(few());
  matcher.setBlockSize(matcher.getBlockSize());
  matcher.setSpeckleRange(matcher.getSpeckleRange());
  EXPECT_THROW(matcher.setBlockSize(5), InvalidArgument);
  EXPECT_THROW(matcher.setSpeckleRange(32), InvalidArgument);
  EXPECT_THROW(matcher.setNumDisparities(0), InvalidArgument);
  EXPECT_THROW(matcher.setMinDisparity(2000), InvalidArgument);
  EXPECT_THROW(matcher.setSpeckleWindowSize(-1), InvalidArgument);
  EXPECT_EQ(matcher.getNumDisparities(), 48);
  EXPECT_EQ(matcher.getMinDisparity(), 0);
}

TEST(Matcher, GivesThePipelinesDisparitiesInSixteenths) {
  const SyntheticSequence sequence = street();
  for (const int least : {0, -3}) {
    PipelineOptions options = few();
    options.min_disparity = least;
    Matcher matcher(sequence.calibration(), options);
    Pipeline pipeline(sequence.calibration(), 160, 64, options);
    for (int k = 0; k < 2; ++k) {
      const Pair frame(sequence.render(k));
      const auto motion = k ? std::optional(sequence.motion(k)) : std::nullopt;
      cv::Mat expected(64, 160, CV_32FC1), found;
      FrameOutputs outputs;
      outputs.disparity = map_view(expected);
      pipeline.process(image_view(frame.left), image_view(frame.right), motion, outputs);
      matcher.compute(frame.left, frame.right, found, motion);
      for (int y = 0; y < 64; ++y) {
        for (int x = 0; x < 160; ++x) {
          const float d = expected.at<float>(y, x);
          const int wanted = d == kInvalidDisparity ? (least - 1) * 16 : cvRound(d * 16);
          ASSERT_EQ(found.at<short>(y, x), wanted) << k << ": " << x << ", " << y;
        }
      }
    }
  }
}

TEST(Matcher, TakesColourDepthAndOtherSizes) {
  const Pair frame(street().render(0));
  Matcher matcher(few());
  const cv::Mat grey = disparity_by(matcher, frame.left, frame.right);
  cv::Mat left, right;
  cv::cvtColor(frame.left, left, cv::COLOR_GRAY2BGR);
  cv::cvtColor(frame.right, right, cv::COLOR_GRAY2BGR);
  Matcher of_colours(few());
  EXPECT_EQ(cv::countNonZero(disparity_by(of_colours, left, right) != grey), 0);
  const cv::Rect part(0, 0, 120, 48);
  EXPECT_EQ(disparity_by(matcher, frame.left(part), frame.right(part)).size(), part.size());
  cv::Mat deep_left, deep_right;
  frame.left.convertTo(deep_left, CV_16U, 257);
  frame.right.convertTo(deep_right, CV_16U, 257);
  EXPECT_EQ(disparity_by(matcher, deep_left, deep_right).type(), CV_16SC1);
  EXPECT_EQ(cv::countNonZero(disparity_by(matcher, frame.left, frame.right) != grey), 0);  // a new pipeline, again
}

TEST(Matcher, RefusesWhatHasNoMeaning) {
  const Pair frame(street().render(0));
  Matcher matcher(few());
  cv::Mat disparity, real;
  frame.left.convertTo(real, CV_32F);
  EXPECT_THROW(matcher.compute(real, real, disparity), InvalidArgument);
  EXPECT_THROW(matcher.compute(cv::Mat(), frame.right, disparity), InvalidArgument);
  EXPECT_THROW(matcher.compute(frame.left, frame.right.colRange(0, 100), disparity), InvalidArgument);
  frame.left.convertTo(real, CV_16U);
  expect_refused([&] { matcher.compute(real, frame.right, disparity); }, {"160x64 of CV_16UC1", "160x64 of CV_8UC1"});
  PipelineOptions wide = few();
  for (const int least : {2000, -2047}) {
    wide.min_disparity = least;
    expect_refused([&] { Matcher{wide}; }, {"do not fit into 16 bits", "-2046 to 2046 do"});
  }
}

}  // namespace
}  // namespace egosgm::vision
