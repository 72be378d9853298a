// SPDX-License-Identifier: Apache-2.0
#include "host/vision/flow_io.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "host/vision/file_io.h"
#include "tests/support/expect_refused.h"
#include "tests/vision/temporary_folder.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

std::string flo(std::int32_t width, std::int32_t height, const std::vector<float>& values) {
  std::string bytes = "PIEH" + std::string(8 + 4 * values.size(), '\0');
  std::memcpy(bytes.data() + 4, &width, 4);
  std::memcpy(bytes.data() + 8, &height, 4);
  if (!values.empty()) std::memcpy(bytes.data() + 12, values.data(), 4 * values.size());
  return bytes;
}

void expect_flow(const cv::Mat& flow, int y, int x, float right, float down) {
  EXPECT_EQ(flow.at<cv::Vec2f>(y, x)[0], right) << y << " " << x;
  EXPECT_EQ(flow.at<cv::Vec2f>(y, x)[1], down) << y << " " << x;
}

bool is_none(const cv::Mat& flow, int y, int x) { return std::isnan(flow.at<cv::Vec2f>(y, x)[0]); }

TEST(FlowIo, KittiStoresFlowInRedAndGreen) {
  const TemporaryFolder folder;
  cv::Mat bgr(1, 2, CV_16UC3);
  bgr.at<cv::Vec3w>(0, 0) = {1, 32768 - 32, 32768 + 64 * 3};
  bgr.at<cv::Vec3w>(0, 1) = {0, 40000, 40000};
  const auto file = folder / "000000_10.png";
  ASSERT_TRUE(cv::imwrite(file.string(), bgr));
  const cv::Mat flow = read_flow(file);
  ASSERT_EQ(flow.type(), CV_32FC2);
  expect_flow(flow, 0, 0, 3, -0.5f);
  EXPECT_TRUE(is_none(flow, 0, 1));
}

TEST(FlowIo, FloIsReadRowByRow) {
  const TemporaryFolder folder;
  const auto file = folder / "f.flo";
  write_file(file, flo(2, 2, {1, 2, 3, 4, 5, 6, 1e10f, 0}));
  const cv::Mat flow = read_flow(file);
  expect_flow(flow, 0, 0, 1, 2);
  expect_flow(flow, 0, 1, 3, 4);
  expect_flow(flow, 1, 0, 5, 6);
  EXPECT_TRUE(is_none(flow, 1, 1)) << "unknown";
}

TEST(FlowIo, WhatIsNoFlowIsRefused) {
  const TemporaryFolder folder;
  const auto file = folder / "f.flo";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "neither KITTI's PNG nor .flo"}, {"PIEH", "truncated"},
      {flo(2, 1, {1, 2}), "2x1"},           {flo(0, 1, {}), "0x1"},
      {flo(-1, -1, {1, 2}), "-1x-1"},       {flo(1 << 20, 1 << 20, {1, 2}), "do not fit"}};
  for (const auto& [bytes, part] : cases) {
    write_file(file, bytes);
    expect_refused([&] { read_flow(file); }, {"f.flo", part});
  }
  ASSERT_TRUE(cv::imwrite((folder / "grey.png").string(), cv::Mat(1, 1, CV_16UC1, cv::Scalar(1))));
  expect_refused([&] { read_flow(folder / "grey.png"); }, {"grey.png", "1 channel(s) of 16 bit"});
}

}  // namespace
}  // namespace egosgm::vision
