// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/video_evaluation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "egosgm/reason.h"
#include "egosgm/vision/disparity_io.h"
#include "host/vision/video_order.h"
#include "tests/support/expect_refused.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

constexpr float kNo = kInvalidDisparity;
constexpr int kWidth = 24, kHeight = 10;

cv::Mat constant(float value) { return cv::Mat(kHeight, kWidth, CV_32FC1, cv::Scalar(value)); }

cv::Mat with(cv::Mat map, cv::Rect where, float value) {
  map(where) = value;
  return map;
}

Calibration calibration() { return {.fx = 100, .fy = 100, .cx = 11.5, .cy = 4.5, .baseline_m = 0.2, .doffs_px = 0}; }

Eigen::Isometry3d moved_by(double x_m, double y_m, double z_m) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.translation() = Eigen::Vector3d(x_m, y_m, z_m);
  return motion;
}

Video video_of(std::vector<VideoFrame> frames) {
  Video video;
  video.frames = static_cast<int>(frames.size());
  video.read = [frames](int i) { return frames[i]; };
  return video;
}

/// With a motion between any two frames.
Video video_of(std::vector<VideoFrame> frames, const Eigen::Isometry3d& motion) {
  Video video = video_of(std::move(frames));
  video.calibration = calibration();
  video.current_from_previous = [motion](int) { return motion; };
  return video;
}

VideoFrame frame_of(cv::Mat estimate, cv::Mat truth = {}) {
  VideoFrame frame;
  frame.estimate = std::move(estimate);
  frame.truth = std::move(truth);
  return frame;
}

std::map<std::string, double> figures(const Video& video) {
  std::map<std::string, double> result;
  for (const NamedFigure& figure : figures_of(evaluate_video(video).total)) result[figure.name] = figure.value;
  return result;
}

const RegionCounts& region(const VideoEvaluation& evaluation, Region which) { return evaluation.total.region(which); }

TEST(VideoEvaluation, AConstantErrorDoesNotFlicker) {
  const auto of = figures(video_of({frame_of(constant(14), constant(10)), frame_of(constant(15), constant(11))}));
  EXPECT_EQ(of.at("tepe_dynamicstereo_px"), 0);
  EXPECT_EQ(of.at("tepe_dynamicstereo_filled_px"), 0);
  EXPECT_TRUE(std::isnan(of.at("flicker_px"))) << "no motion is known";
  EXPECT_TRUE(std::isnan(of.at("tepe_codd_px")));
}

TEST(VideoEvaluation, TepeOfAJumpAndAHole) {
  // Three frames; the second one is 2 px too large in a block of 20 pixels and 4 px in one of 5, and has a hole of 10.
  cv::Mat second = with(with(constant(10), {2, 2, 5, 4}, 12), {10, 2, 5, 1}, 14);
  second = with(second, {12, 6, 10, 1}, kNo);
  const Video video = video_of(
      {frame_of(constant(10), constant(10)), frame_of(second, constant(10)), frame_of(constant(10), constant(10))});
  const TemporalCounts tepe = region(evaluate_video(video), Region::kAll).tepe;
  EXPECT_EQ(tepe.pixels, 2 * (kWidth * kHeight - 10));
  EXPECT_DOUBLE_EQ(tepe.sum_px, 2 * (20 * 2 + 5 * 4));
  EXPECT_EQ(tepe.above_1px, 2 * 25);
  EXPECT_EQ(tepe.above_3px, 2 * 5);
  EXPECT_EQ(tepe.pairs, 2);
  EXPECT_DOUBLE_EQ(tepe.sum_of_pair_means_px, 2 * 60.0 / (kWidth * kHeight - 10));
  const TemporalCounts filled = region(evaluate_video(video), Region::kAll).tepe_interpolated;
  EXPECT_EQ(filled.pixels, 2 * kWidth * kHeight) << "the hole is filled from beside";
  EXPECT_DOUBLE_EQ(filled.sum_px, tepe.sum_px);
}

TEST(VideoEvaluation, AStepOfExactlyOnePixelIsNotAboveOne) {
  const auto of = figures(video_of({frame_of(constant(10), constant(10)), frame_of(constant(11), constant(10))}));
  EXPECT_EQ(of.at("tepe_dynamicstereo_px"), 1);
  EXPECT_EQ(of.at("tepe_dynamicstereo_above_1px_percent"), 0);
}

TEST(VideoEvaluation, OnlySuccessorsArePairs) {
  Video video = video_of({frame_of(constant(10), constant(10)), frame_of(constant(11), constant(10)),
                          frame_of(constant(13), constant(10))});
  video.follows = [](int i) { return i == 2; };
  const VideoEvaluation evaluation = evaluate_video(video);
  EXPECT_DOUBLE_EQ(region(evaluation, Region::kAll).tepe.sum_of_pair_means_px, 2);
  EXPECT_EQ(region(evaluation, Region::kAll).tepe.pairs, 1);
}

TEST(VideoEvaluation, FlickerFollowsTheMotion) {
  // 10 px are 2 m away: 0.2 m sideways moves the image by 10 px, and leaves the disparity as it is.
  cv::Mat ramp = constant(10);
  ramp.at<float>(3, 15) = 12;
  const Video still = video_of({frame_of(ramp), frame_of(ramp)}, moved_by(0, 0, 0));
  EXPECT_EQ(figures(still).at("flicker_px"), 0);
  EXPECT_EQ(evaluate_video(still).total.flicker.pixels, kWidth * kHeight);
  const Video video = video_of({frame_of(ramp), frame_of(constant(10.5f))}, moved_by(-0.2, 0, 0));
  const TemporalCounts flicker = evaluate_video(video).total.flicker;
  // All columns move by 10; the point of 12 px is nearer, moves by 12 and lies on top of its neighbour, whichever of
  // the two comes first in the row.
  EXPECT_EQ(flicker.pixels, (kWidth - 10) * kHeight - 1);
  EXPECT_NEAR(flicker.sum_px, 0.5 * ((kWidth - 10) * kHeight - 2) + 1.5, 1e-4);
  ramp.at<float>(3, 15) = 10, ramp.at<float>(3, 5) = 12;
  const Video other_way = video_of({frame_of(ramp), frame_of(constant(10.5f))}, moved_by(0.2, 0, 0));
  EXPECT_NEAR(evaluate_video(other_way).total.flicker.sum_px, flicker.sum_px, 1e-4);
}

TEST(VideoEvaluation, AForwardMotionIsTakenOutOfTheFlicker) {
  // At 2 m and 1 m nearer: from 10 px to 20 px.
  const Video video = video_of({frame_of(constant(10)), frame_of(constant(20))}, moved_by(0, 0, -1));
  EXPECT_NEAR(figures(video).at("flicker_px"), 0, 1e-5);
  EXPECT_NEAR(figures(video).at("tae_vda_percent"), 0, 1e-5);
}

TEST(VideoEvaluation, TaeIsRelativeToTheTargetsDepthInBothDirections) {
  // Depths 2 m and 1 m: |1 - 2| / 1 there, |2 - 1| / 2 back.
  const Video video = video_of({frame_of(constant(10)), frame_of(constant(20))}, moved_by(0, 0, 0));
  EXPECT_NEAR(figures(video).at("tae_vda_percent"), (100.0 + 50.0) / 2, 1e-4);
  EXPECT_EQ(evaluate_video(video).total.tae_percent.pairs, 2);
}

TEST(VideoEvaluation, TepeAlongTheMotionOfAStillScene) {
  // The scene stands, the camera comes nearer: the truth changes by 10 px, the estimate by 11.
  const Video video =
      video_of({frame_of(constant(10), constant(10)), frame_of(constant(21), constant(20))}, moved_by(0, 0, -1));
  const auto of = figures(video);
  EXPECT_NEAR(of.at("tepe_codd_px"), 1, 1e-6);
  EXPECT_NEAR(of.at("tepe_codd_relative"), 1 / 10.001, 1e-6);
  EXPECT_EQ(of.at("tepe_codd_above_3px_percent"), 0);
  EXPECT_NEAR(of.at("tepe_dynamicstereo_px"), 1, 1e-6) << "of a plane both are the same";
}

TEST(VideoEvaluation, WhatMovesOrIsHiddenIsNotAlongTheMotion) {
  VideoFrame before = frame_of(constant(10), constant(10)), now = frame_of(constant(11), constant(10));
  before.moving = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(0));
  now.moving = before.moving.clone();
  before.moving(cv::Rect(0, 0, 4, 1)) = 255;
  now.truth = with(now.truth, {10, 5, 3, 1}, 15);  // something new in front
  const TemporalCounts along = evaluate_video(video_of({before, now}, moved_by(0, 0, 0))).total.tepe_along_motion;
  EXPECT_EQ(along.pixels, kWidth * kHeight - 4 - 3);
  EXPECT_DOUBLE_EQ(along.sum_px, static_cast<double>(along.pixels));
}

TEST(VideoEvaluation, TepeAlongAGivenFlow) {
  // A square of 4x3 pixels moves by (3, 1) and comes nearer by 2 px; its estimate by 5.
  VideoFrame before = frame_of(with(constant(5), {2, 2, 4, 3}, 20), with(constant(5), {2, 2, 4, 3}, 20));
  const VideoFrame now = frame_of(with(constant(5), {5, 3, 4, 3}, 25), with(constant(5), {5, 3, 4, 3}, 22));
  const float none = std::nanf("");
  before.flow_to_next = cv::Mat(kHeight, kWidth, CV_32FC2, cv::Scalar(none, none));
  before.flow_to_next(cv::Rect(2, 2, 4, 3)) = cv::Scalar(3.4, 0.6);
  TemporalCounts along = evaluate_video(video_of({before, now})).total.tepe_along_motion;
  EXPECT_EQ(along.pixels, 12);
  EXPECT_DOUBLE_EQ(along.sum_px, 12 * 3.0);
  EXPECT_EQ(along.above_3px, 0);
  EXPECT_EQ(along.relative_above_1, 12) << "3 px of a change of 2";
  before.next_truth = constant(24);  // the given truth of the next frame counts, not the one at its pixel
  along = evaluate_video(video_of({before, now})).total.tepe_along_motion;
  EXPECT_DOUBLE_EQ(along.sum_px, 12 * 1.0);
  VideoFrame without_truth = frame_of(now.estimate);
  EXPECT_EQ(evaluate_video(video_of({before, without_truth})).total.tepe_along_motion.pixels, 12)
      << "disp_1 needs no truth of the next frame's own";
}

TEST(VideoEvaluation, OpwAndRtcInterpolateAlongTheFlow) {
  VideoFrame before = frame_of(constant(10)), now = frame_of(constant(0));
  for (int x = 0; x < kWidth; ++x) now.estimate.col(x) = 10.0f + static_cast<float>(x);
  before.flow_to_next = cv::Mat(kHeight, kWidth, CV_32FC2, cv::Scalar(std::nanf(""), std::nanf("")));
  before.flow_to_next.at<cv::Vec2f>(4, 6) = {-4.75f, 0};  // to 11.25: ratio 1.125
  before.flow_to_next.at<cv::Vec2f>(5, 6) = {-5.95f, 0};  // to 10.05: ratio 1.005
  before.flow_to_next.at<cv::Vec2f>(6, 6) = {-6.5f, 0};   // outside
  const auto of = figures(video_of({before, now}));
  EXPECT_NEAR(of.at("opw_nvds_px"), (1.25 + 0.05) / 2, 1e-5);
  EXPECT_EQ(of.at("rtc_1_01_percent"), 50);
  EXPECT_EQ(of.at("rtc_1_25_percent"), 100);
  EXPECT_TRUE(std::isnan(of.at("opw_nvds_m"))) << "no calibration";
  // In depth, 20 / d: the mean of the depths of 11 and 12 px, 3 to 1, and of 10 and 11 px, 95 to 5.
  const double first = std::abs(2 - (0.75 * 20 / 11 + 0.25 * 20 / 12)),
               second = std::abs(2 - (0.95 * 2 + 0.05 * 20 / 11));
  EXPECT_NEAR(figures(video_of({before, now}, moved_by(0, 0, 0))).at("opw_nvds_m"), (first + second) / 2, 1e-6);
}

TEST(VideoEvaluation, OpwLeavesOutWhatDoesNotLookAlike) {
  VideoFrame before = frame_of(constant(10)), now = frame_of(constant(12));
  before.flow_to_next = cv::Mat(kHeight, kWidth, CV_32FC2, cv::Scalar(0, 0));
  before.image = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(100));
  now.image = before.image.clone();
  now.image(cv::Rect(0, 0, kWidth, 5)) = 113;  // sqrt(3) * 13 / 255 = 0.0883: exp(-4.4) = 0.012
  EXPECT_EQ(evaluate_video(video_of({before, now})).total.opw_px.value(), 2);
  now.estimate(cv::Rect(0, 0, kWidth, 5)) = 50.0f;
  EXPECT_EQ(evaluate_video(video_of({before, now})).total.opw_px.value(), (2 + 40) / 2.0);
  now.image(cv::Rect(0, 0, kWidth, 5)) = 114;  // 0.0951: exp(-4.75) = 0.0086
  EXPECT_EQ(evaluate_video(video_of({before, now})).total.opw_px.value(), 2);
}

TEST(VideoEvaluation, HarmAndHelp) {
  VideoFrame frame = frame_of(constant(10), constant(10));
  frame.against = constant(10);
  frame.estimate.at<float>(0, 0) = 12;                                     // worse
  frame.against.at<float>(0, 1) = 12;                                      // better
  frame.against.at<float>(0, 2) = 13;                                      // better
  frame.estimate.at<float>(0, 3) = 11;                                     // not changed by more than 1 px
  frame.estimate.at<float>(0, 4) = 9, frame.against.at<float>(0, 4) = 11;  // changed, equally wrong
  frame.estimate.at<float>(0, 5) = kNo;
  frame.truth.at<float>(0, 6) = kNo, frame.estimate.at<float>(0, 6) = 50;
  const ChangeCounts counts = region(evaluate_video(video_of({frame})), Region::kAll).against;
  EXPECT_EQ(counts.both, kWidth * kHeight - 2);
  EXPECT_EQ(counts.changed, 4);
  EXPECT_EQ(counts.worse, 1);
  EXPECT_EQ(counts.better, 2);
}

/// Eleven pixels in one row: estimate, the other one's estimate and the truth.
VideoFrame gains_and_losses() {
  VideoFrame frame;
  frame.estimate = (cv::Mat_<float>(1, 11) << 10, 20, 20, kNo, kNo, 10, kNo, kNo, 2, 20, 9);
  frame.against = (cv::Mat_<float>(1, 11) << kNo, kNo, 10, 10, 20, 20, 0, 9, kNo, kNo, 9);
  frame.truth = (cv::Mat_<float>(1, 11) << 10, 10, 10, 10, 10, 10, 0, 0, 0, 0, kNo);
  return frame;
}

TEST(VideoEvaluation, GainedAndLostBesideAnotherMethod) {
  const Video video = video_of({gains_and_losses()});
  const ChangeCounts counts = region(evaluate_video(video), Region::kAll).against;
  EXPECT_EQ(counts.truth, 10);
  EXPECT_EQ(counts.gained, 4);
  EXPECT_EQ(counts.gained_right, 2) << "at 10 px, and in the sky at 2 px";
  EXPECT_EQ(counts.lost_right, 2) << "wrong now, and missing; a hole in the sky is no loss";
  const auto of = figures(video);
  EXPECT_DOUBLE_EQ(of.at("gained_percent"), 40);
  EXPECT_DOUBLE_EQ(of.at("gained_right_percent"), 50);
  EXPECT_DOUBLE_EQ(of.at("lost_right_percent"), 20);
  EXPECT_TRUE(std::isnan(of.at("wrong_of_trusted_percent"))) << "no reasons are known";
}

TEST(VideoEvaluation, WrongAmongTheTrusted) {
  VideoFrame frame = gains_and_losses();
  frame.reason = cv::Mat(1, 11, CV_8UC1, cv::Scalar(static_cast<int>(Reason::kTrusted)));
  frame.reason.at<std::uint8_t>(0, 2) = static_cast<std::uint8_t>(Reason::kFlat);
  const TrustCounts counts = region(evaluate_video(video_of({frame, frame})), Region::kAll).trust;
  EXPECT_EQ(counts.valid, 2 * 6);
  EXPECT_EQ(counts.bad, 2 * 3);
  EXPECT_EQ(counts.trusted, 2 * 5);
  EXPECT_EQ(counts.trusted_bad, 2 * 2);
  const auto of = figures(video_of({frame}));
  EXPECT_DOUBLE_EQ(of.at("wrong_of_trusted_percent"), 40);
  EXPECT_DOUBLE_EQ(of.at("trusted_of_wrong_percent"), 100 * 2.0 / 3);
}

TEST(VideoEvaluation, TheSkyIsARegion) {
  const VideoEvaluation evaluation = evaluate_video(video_of({gains_and_losses()}));
  const DisparityCounts& sky = region(evaluation, Region::kSky).errors;
  EXPECT_EQ(sky.truth, 4);
  EXPECT_EQ(sky.valid, 2);
  EXPECT_EQ(region(evaluation, Region::kFar).errors.truth, 10) << "it is far, too";
}

TEST(VideoEvaluation, DensityKeepsTheMostCertain) {
  // 240 pixels with truth; 200 have an estimate, of which the 40 least certain ones are off by 5 px.
  VideoFrame frame = frame_of(constant(10), constant(10));
  frame.estimate(cv::Rect(0, 0, 4, kHeight)) = kNo;
  frame.uncertainty = constant(1);
  frame.estimate(cv::Rect(4, 0, 4, kHeight)) = 15.0f;
  frame.uncertainty(cv::Rect(4, 0, 4, kHeight)) = 2.0f;
  const VideoEvaluation evaluation = evaluate_video(video_of({frame}));
  const DensityCounts& counts = evaluation.total.density;
  EXPECT_EQ(counts.kept.back(), 200);
  EXPECT_EQ(counts.bad.back(), 40);
  EXPECT_EQ(counts.bad[39], 0) << "80 %";
  EXPECT_EQ(counts.bad[44], 20) << "90 %";
  EXPECT_EQ(counts.kept_of_truth[0], 120);
  EXPECT_EQ(counts.kept_of_truth[10], 200) << "as many as there are";
  EXPECT_EQ(counts.bad_of_kept[10], 40);
  EXPECT_EQ(counts.bad_of_kept[4], 8) << "70 % of 240 are 168";
  EXPECT_DOUBLE_EQ(counts.ause_px(), 0) << "the order is the oracle's";
  frame.uncertainty *= -1;  // the worst first
  const DensityCounts worst = evaluate_video(video_of({frame})).total.density;
  EXPECT_EQ(worst.bad[0], 4);
  EXPECT_GT(worst.ause_px(), 1);
  EXPECT_NEAR(worst.ause_percent(), 20 * worst.ause_px(), 1e-9) << "each bad pixel is off by 5 px";
}

TEST(VideoEvaluation, RegionsFollowFromTruthAndMotion) {
  // The camera moves to the right by 0.1 m: a wall of 10 px goes 5 px to the left, what stands before it (40 px) 20 px.
  VideoFrame before = frame_of(constant(10), with(constant(10), {20, 2, 3, 4}, 40));
  VideoFrame now = frame_of(constant(10), with(constant(10), {0, 2, 3, 4}, 40));
  now.moving = cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(0));
  now.moving(cv::Rect(0, 9, 7, 1)) = 1;
  const VideoEvaluation evaluation = evaluate_video(video_of({before, now}, moved_by(-0.1, 0, 0)));
  const VideoCounts& counts = evaluation.frames[1];
  EXPECT_EQ(counts.region(Region::kAll).errors.truth, kWidth * kHeight);
  EXPECT_EQ(counts.region(Region::kNear).errors.truth, 12);
  EXPECT_EQ(counts.region(Region::kFar).errors.truth, kWidth * kHeight - 12);
  EXPECT_EQ(counts.region(Region::kMoving).errors.truth, 7);
  EXPECT_EQ(counts.region(Region::kStill).errors.truth, kWidth * kHeight - 7);
  // Five columns enter on the right; behind the near thing, columns 15 to 17 of rows 2 to 5 were hidden.
  EXPECT_EQ(counts.region(Region::kUncovered).errors.truth, 5 * kHeight + 12);
  // The jumps lie between columns 2, 3 and rows 1, 2 and 5, 6, none in the corners: 3 pixels around those beside them.
  EXPECT_EQ(counts.region(Region::kEdges).errors.truth, 6 * 10 + 9);
  EXPECT_EQ(evaluation.frames[0].region(Region::kStill).errors.truth, 0) << "no mask, no knowledge";
  EXPECT_EQ(evaluation.frames[0].region(Region::kUncovered).errors.truth, 0);
}

TEST(VideoEvaluation, ThreadsChangeNothing) {
  std::vector<VideoFrame> frames;
  cv::RNG random(7);
  for (int i = 0; i < 40; ++i) {
    cv::Mat estimate(kHeight, kWidth, CV_32FC1);
    random.fill(estimate, cv::RNG::UNIFORM, 5, 30);
    frames.push_back(frame_of(estimate, constant(12)));
    frames.back().uncertainty = estimate;
  }
  const Video video = video_of(frames, moved_by(0.01, 0, -0.05));
  const auto one = evaluate_video(video, {.near_px = 32, .threads = 1}),
             four = evaluate_video(video, {.near_px = 32, .threads = 4});
  const auto a = figures_of(one.total), b = figures_of(four.total);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(a[i].value == b[i].value || (std::isnan(a[i].value) && std::isnan(b[i].value))) << a[i].name;
  }
  EXPECT_EQ(region(four, Region::kAll).tepe.pairs, 39);
}

TEST(VideoEvaluation, WhatDoesNotFitIsRefused) {
  VideoFrame odd = frame_of(constant(10), cv::Mat(3, 4, CV_32FC1, cv::Scalar(1)));
  expect_refused([&] { evaluate_video(video_of({frame_of(constant(10)), odd})); }, {"frame 1", "24x10", "4x3"});
  VideoFrame flow = frame_of(constant(10));
  flow.flow_to_next = constant(1);
  expect_refused([&] { evaluate_video(video_of({flow})); }, {"frame 0", "flow", "type"});
  expect_refused([&] { evaluate_video(Video{}); }, {"no frames"});
  expect_refused(
      [&] {
        evaluate_video(video_of({frame_of(constant(1)), frame_of(cv::Mat(3, 4, CV_32FC1, cv::Scalar(1)))}));
      },
      {"frame 1", "4x3", "24x10"});
}

TEST(VideoOrder, SuccessorsDifferByTheUsualDistance) {
  using Bools = std::vector<bool>;
  EXPECT_EQ(find_successors({"000003", "000004", "000005", "000007", "000008"}),
            Bools({false, true, true, false, true}));
  EXPECT_EQ(find_successors({"000000_10", "000001_10", "000001_11"}), Bools({false, false, true}));
  EXPECT_EQ(find_successors({"0", "5", "10", "20"}), Bools({false, true, true, false})) << "every fifth frame";
  EXPECT_EQ(find_successors({"1403636579763555584", "1403636579813555456", "1403636579863555584"}),
            Bools({false, true, true}))
      << "nanoseconds";
  EXPECT_EQ(find_successors({"a", "b"}), Bools({false, false}));
  EXPECT_EQ(find_successors({}), Bools());
}

}  // namespace
}  // namespace egosgm::vision
