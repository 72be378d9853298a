// SPDX-License-Identifier: Apache-2.0
// opencv_types LEFT.png RIGHT.png OUT.png: one rectified pair from and to cv::Mat, in the place of cv::StereoSGBM.
// OUT.png is in KITTI's format: 256 steps a pixel, 0 where there is no disparity.
#include <egosgm/pipeline.h>
#include <egosgm/vision/opencv.h>

#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

using namespace egosgm;

/// What cv::StereoSGBM::compute gives: CV_16SC1, 16 steps a pixel, -16 where there is none.
cv::Mat compute(Pipeline& pipeline, const cv::Mat& left, const cv::Mat& right) {
  const cv::Mat disparity = cv::max(vision::process(pipeline, left, right, {}).disparity, -1);
  cv::Mat fixed;
  disparity.convertTo(fixed, CV_16S, 16);
  return fixed;
}

int main(int argc, char** argv) try {
  if (argc != 4) throw std::runtime_error("usage: opencv_types LEFT.png RIGHT.png OUT.png");
  const cv::Mat left = cv::imread(argv[1], cv::IMREAD_GRAYSCALE), right = cv::imread(argv[2], cv::IMREAD_GRAYSCALE);
  if (left.empty() || right.empty()) throw std::runtime_error("an image cannot be read");
  PipelineOptions options;
  options.temporal = false;  // one pair alone: the calibration does not matter
  Pipeline pipeline({.fx = 1, .fy = 1, .baseline_m = 1}, left.cols, left.rows, options);
  cv::Mat stored;
  compute(pipeline, left, right).convertTo(stored, CV_16U, 16);  // negative ones become 0
  if (!cv::imwrite(argv[3], stored)) throw std::runtime_error("the result cannot be written");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
