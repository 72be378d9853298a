// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/opencv.h"

#include <gtest/gtest.h>

#include <cstring>

#include "egosgm/vision/synthetic.h"
#include "tests/support/expect_refused.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

bool same_bits(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && a.isContinuous() && b.isContinuous() &&
         std::memcmp(a.data, b.data, a.total() * a.elemSize()) == 0;
}

// A part of a larger image has rows that are not continuous.
TEST(OpenCv, ProcessGivesTheMapsOfThePipeline) {
  const SyntheticSequence street({.frames = 2, .width = 96, .height = 40, .supersampling = 1});
  PipelineOptions options;
  options.disparities = 32;
  Pipeline pipeline(street.calibration(), 96, 40, options), expected(street.calibration(), 96, 40, options);
  for (int k = 0; k < 2; ++k) {
    const SyntheticFrame frame = street.render(k);
    const std::optional<Motion> motion = k > 0 ? std::optional(street.motion(k)) : std::nullopt;
    cv::Mat disparity(40, 96, CV_32FC1), variance(40, 96, CV_32FC1), large(50, 200, CV_8UC1);
    FrameOutputs outputs;
    outputs.disparity = map_view(disparity);
    outputs.variance = map_view(variance);
    expected.process(image_view(frame.left), image_view(frame.right), motion, outputs);
    const cv::Mat left = large(cv::Rect(3, 4, 96, 40)), right = large(cv::Rect(101, 7, 96, 40));
    mat_of(frame.left).copyTo(left);
    mat_of(frame.right).copyTo(right);
    const FrameMats maps = process(pipeline, left, right, motion);
    EXPECT_TRUE(same_bits(maps.disparity, disparity)) << "frame " << k;
    EXPECT_TRUE(same_bits(maps.variance, variance)) << "frame " << k;
    EXPECT_EQ(maps.report.unpredicted, k > 0 ? std::nullopt : std::optional(Unpredicted::kFirstFrame));
  }
  expect_refused([&] { process(pipeline, cv::Mat(), cv::Mat(), {}); }, {"left image: no data"});
  expect_refused([&] { process(pipeline, cv::Mat(40, 96, CV_8UC3), cv::Mat(40, 96, CV_8UC3), {}); }, {"uint8"});
  expect_refused([&] { process(pipeline, cv::Mat(41, 96, CV_8UC1), cv::Mat(41, 96, CV_8UC1), {}); }, {"96x41"});
}

TEST(OpenCv, ViewsKeepTheStride) {
  cv::Mat image(10, 20, CV_16UC1);
  const ImageView view = image_view(image(cv::Rect(3, 2, 5, 4)));
  EXPECT_EQ(view.data, image.ptr<std::uint16_t>(2) + 3);
  EXPECT_EQ(view.width, 5);
  EXPECT_EQ(view.height, 4);
  EXPECT_EQ(view.stride_bytes, 40);
  EXPECT_EQ(view.type, PixelType::kU16);
  cv::Mat map(4, 5, CV_32FC1);
  EXPECT_EQ(map_view(map).data, map.ptr<float>());
  EXPECT_EQ(map_view(map).stride_bytes, 20);
  expect_refused([&] { image_view(map); }, {"uint8"});
  expect_refused([&] { map_view(image); }, {"float32"});
}

TEST(OpenCv, ImagesAndMatricesShareTheirMemoryWhichTheImageKeeps) {
  Image image;
  {
    cv::Mat large(6, 10, CV_16UC3, cv::Scalar(1, 2, 3));
    image = image_of(large(cv::Rect(2, 1, 5, 4)));
    large.at<cv::Vec3w>(1, 2) = {7, 8, 9};
  }
  EXPECT_EQ(image.size(), (Size{5, 4}));
  EXPECT_EQ(image.type, kBgr16);
  EXPECT_EQ(image.row<std::uint16_t>(0)[2], 9);
  EXPECT_EQ(image.row<std::uint16_t>(3)[14], 3);
  const cv::Mat mat = mat_of(image);
  EXPECT_EQ(mat.type(), CV_16UC3);
  EXPECT_EQ(mat.data, image.data);
  EXPECT_EQ(mat.step[0], image.stride_bytes);
  EXPECT_TRUE(mat_of(Image()).empty());
  expect_refused([&] { image_of(cv::Mat(2, 2, CV_64FC1)); }, {"CV_64FC1", "CV_32F"});
}

}  // namespace
}  // namespace egosgm::vision
