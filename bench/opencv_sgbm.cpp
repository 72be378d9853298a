// SPDX-License-Identifier: Apache-2.0
// egosgm_opencv_sgbm MODE LEFT RIGHT DISPARITIES OUT: OpenCV's disparity as KITTI's PNG, for bench/accuracy. The images
// are padded on the left by the disparity range, or StereoSGBM gives nothing in these columns.
#include <charconv>
#include <cstdio>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <string>

#include "bench/opencv_matcher.h"
#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/opencv.h"

namespace egosgm::bench {
namespace {

int mode_named(const std::string& name) {
  for (const OpencvMode& mode : kOpencvModes) {
    if (name == mode.name) return mode.mode;
  }
  throw InvalidArgument(name + ": choose opencv_hh, opencv_hh4, opencv_sgbm or opencv_3way");
}

int parse_disparities(const std::string& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 1 || value > 1024) {
    throw InvalidArgument(text + ": give 1 to 1024 disparities");
  }
  return value;
}

cv::Mat padded(const cv::Mat& image, int columns) {
  cv::Mat result;
  cv::copyMakeBorder(image, result, 0, 0, columns, 0, cv::BORDER_REPLICATE);
  return result;
}

cv::Mat match(const cv::Mat& left, const cv::Mat& right, int mode, int disparities) {
  const int columns = (disparities + 15) / 16 * 16;
  cv::Mat fixed_point, disparity;
  make_opencv_matcher(mode, disparities)->compute(padded(left, columns), padded(right, columns), fixed_point);
  fixed_point = fixed_point.colRange(columns, fixed_point.cols);
  fixed_point.convertTo(disparity, CV_32FC1, 1.0 / static_cast<int>(cv::StereoMatcher::DISP_SCALE));
  disparity.setTo(kInvalidDisparity, fixed_point < 0);
  return disparity;
}

}  // namespace
}  // namespace egosgm::bench

int main(int argc, char** argv) {
  using namespace egosgm;
  if (argc != 6) {
    std::fprintf(
        stderr,
        "usage: egosgm_opencv_sgbm opencv_hh|opencv_hh4|opencv_sgbm|opencv_3way LEFT RIGHT DISPARITIES OUT.png\n");
    return 2;
  }
  try {
    const vision::Image left = vision::read_grey_image(argv[2]), right = vision::read_grey_image(argv[3]);
    vision::write_disparity_png(
        argv[5], vision::image_of(bench::match(vision::mat_of(left), vision::mat_of(right), bench::mode_named(argv[1]),
                                               bench::parse_disparities(argv[4]))));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "egosgm_opencv_sgbm: %s\n", error.what());
    return 1;
  }
}
