// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/rectification.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"

namespace egosgm::vision {
namespace {

constexpr double kMaxBaseline_m = 10;

std::string short_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string size_text(cv::Size size) { return std::to_string(size.width) + "x" + std::to_string(size.height); }

void check_shape(const char* name, const cv::Mat& matrix, int rows, int cols) {
  if (matrix.type() == CV_64FC1 && matrix.size() == cv::Size(cols, rows) && cv::checkRange(matrix)) return;
  throw InvalidArgument(std::string(name) + ": needs " + std::to_string(rows) + "x" + std::to_string(cols) +
                        " finite numbers (CV_64F)");
}

void check_distortion(const char* name, const cv::Mat& matrix, bool is_fisheye) {
  const std::size_t count = matrix.total();
  const bool fits = count == 4 || (!is_fisheye && (count == 5 || count == 8 || count == 12 || count == 14));
  if (matrix.type() == CV_64FC1 && std::min(matrix.rows, matrix.cols) == 1 && fits && cv::checkRange(matrix)) return;
  throw InvalidArgument(std::string(name) + ": needs 4" + (is_fisheye ? "" : ", 5, 8, 12 or 14") +
                        " finite numbers (CV_64F)");
}

void check_lens(const char* name, const cv::Mat& matrix) {
  if (matrix.at<double>(0, 0) > 0 && matrix.at<double>(1, 1) > 0 && matrix.at<double>(2, 2) == 1) return;
  throw InvalidArgument(std::string(name) + " is no camera matrix: fx and fy are above 0, its last row is 0 0 1");
}

void check_shapes(const StereoRig& rig) {
  check_shape("M1", rig.left.matrix, 3, 3);
  check_shape("M2", rig.right.matrix, 3, 3);
  check_distortion("D1", rig.left.distortion, rig.is_fisheye);
  check_distortion("D2", rig.right.distortion, rig.is_fisheye);
  check_shape("R", rig.R, 3, 3);
  check_shape("T", rig.T, 3, 1);
  const char* names[4] = {"R1", "R2", "P1", "P2"};
  for (int i = 0; i < 4; ++i) {
    if (rig.given[i].has_value() != rig.given[0].has_value()) {
      throw InvalidArgument("R1, R2, P1 and P2 belong together: give all four or none");
    }
    if (rig.given[i]) check_shape(names[i], *rig.given[i], 3, i < 2 ? 3 : 4);
  }
}

/// Rounded to a few digits, as files have them.
void check_rotation(const char* name, const cv::Mat& R) {
  constexpr double kMaxError = 1e-2;
  const double error = cv::norm(R * R.t() - cv::Mat::eye(3, 3, CV_64F), cv::NORM_INF);
  if (error <= kMaxError && cv::determinant(R) > 0) return;
  throw InvalidArgument(std::string(name) +
                        " is no rotation: its rows are not of length 1 and at right angles; give "
                        "the calibration as it was computed");
}

void check_stance(const cv::Mat& T) {
  const double x = T.at<double>(0), y = T.at<double>(1), z = T.at<double>(2);
  const std::string text = "T = (" + short_text(x) + ", " + short_text(y) + ", " + short_text(z) + ") m: ";
  constexpr double kLeastDistance_m = 1e-6;
  if (!(std::hypot(x, y, z) >= kLeastDistance_m)) {
    throw InvalidArgument(text + "the cameras stand in one place; give the calibration of two");
  }
  if (std::abs(x) < std::abs(y) || std::abs(x) < std::abs(z)) {
    throw InvalidArgument(text + "the cameras do not stand side by side; turn the images by 90 degrees");
  }
  if (x > 0) {
    throw InvalidArgument(text +
                          "the second camera stands left of the first: is this the inverse of the transformation from "
                          "the first camera's points to the second's? Else exchange left and right, images and "
                          "calibration");
  }
  if (-x > kMaxBaseline_m) {
    throw InvalidArgument("the baseline is " + short_text(-x) +
                          " m: is T in centimetres or millimetres? give --unit cm (unit_m 0.01) or --unit mm (unit_m "
                          "0.001)");
  }
}

/// The largest upright rectangle of valid pixels (one pass over histograms of columns).
cv::Rect largest_rectangle(const cv::Mat& valid) {
  cv::Rect best;
  std::vector<int> heights(static_cast<std::size_t>(valid.cols) + 1, 0);
  for (int y = 0; y < valid.rows; ++y) {
    std::vector<int> open;
    for (int x = 0; x <= valid.cols; ++x) {
      const auto at = static_cast<std::size_t>(x);
      heights[at] = x < valid.cols && valid.at<std::uint8_t>(y, x) ? heights[at] + 1 : 0;
      while (!open.empty() && heights[static_cast<std::size_t>(open.back())] >= heights[at]) {
        const int height = heights[static_cast<std::size_t>(open.back())];
        open.pop_back();
        const int left = open.empty() ? 0 : open.back() + 1;
        if (height * (x - left) > best.area()) best = {left, y - height + 1, x - left, height};
      }
      open.push_back(x);
    }
  }
  return best;
}

}  // namespace

Rectification rectification_of(const StereoRig& rig, cv::Size size, double alpha) {
  if (size.width < 1 || size.height < 1 || size.width > kMaxImageSide || size.height > kMaxImageSide) {
    throw InvalidArgument("size " + size_text(size) + ": choose sides from 1 to " + std::to_string(kMaxImageSide));
  }
  if (!(alpha >= 0 && alpha <= 1)) throw InvalidArgument("alpha " + short_text(alpha) + ": choose from 0 to 1");
  check_shapes(rig);
  if (rig.size && *rig.size != size) {
    throw InvalidArgument("the images are " + size_text(size) + ", but " + size_text(*rig.size) +
                          " were calibrated: give the calibration of this size");
  }
  check_rotation("R", rig.R);
  if (rig.given[0]) check_rotation("R1", *rig.given[0]);
  if (rig.given[1]) check_rotation("R2", *rig.given[1]);
  check_stance(rig.T);
  cv::Mat R1, R2, P1, P2, Q;
  if (rig.given[0]) {
    R1 = *rig.given[0], R2 = *rig.given[1], P1 = *rig.given[2], P2 = *rig.given[3];
  } else {
    check_lens("M1", rig.left.matrix);
    check_lens("M2", rig.right.matrix);
    if (rig.is_fisheye) {
      cv::fisheye::stereoRectify(rig.left.matrix, rig.left.distortion, rig.right.matrix, rig.right.distortion, size,
                                 rig.R, rig.T, R1, R2, P1, P2, Q, cv::CALIB_ZERO_DISPARITY, size, alpha);
    } else {
      cv::stereoRectify(rig.left.matrix, rig.left.distortion, rig.right.matrix, rig.right.distortion, size, rig.R,
                        rig.T, R1, R2, P1, P2, Q, cv::CALIB_ZERO_DISPARITY, alpha, size);
    }
  }
  Rectification result;
  result.calibration = {.fx = P1.at<double>(0, 0),
                        .fy = P1.at<double>(1, 1),
                        .cx = P1.at<double>(0, 2),
                        .cy = P1.at<double>(1, 2),
                        .baseline_m = -P2.at<double>(0, 3) / P2.at<double>(0, 0),
                        .doffs_px = P2.at<double>(0, 2) - P1.at<double>(0, 2)};
  result.calibration.validate();
  const auto map = [&](const StereoRig::Camera& camera, const cv::Mat& R, const cv::Mat& P, cv::Mat(&maps)[2]) {
    if (rig.is_fisheye) {
      cv::fisheye::initUndistortRectifyMap(camera.matrix, camera.distortion, R, P, size, CV_32FC1, maps[0], maps[1]);
    } else {
      cv::initUndistortRectifyMap(camera.matrix, camera.distortion, R, P, size, CV_32FC1, maps[0], maps[1]);
    }
    cv::Mat valid;
    cv::remap(cv::Mat(size, CV_8UC1, cv::Scalar(255)), valid, maps[0], maps[1], cv::INTER_LINEAR);
    return cv::Mat(valid == 255);
  };
  result.valid = map(rig.left, R1, P1, result.left_map);
  result.valid_left = largest_rectangle(result.valid);
  result.valid_right = largest_rectangle(map(rig.right, R2, P2, result.right_map));
  for (const auto& [side, valid] : {std::pair{"left", result.valid_left}, std::pair{"right", result.valid_right}}) {
    if (!valid.empty()) continue;
    throw InvalidArgument(std::string("after rectification none of the ") + side +
                          " image's pixels are left: give the calibration of these cameras");
  }
  return result;
}

cv::Mat rectify(const cv::Mat& image, const cv::Mat (&map)[2]) {
  if (image.size() != map[0].size()) {
    throw InvalidArgument("an image is " + size_text(image.size()) + ", the rectification is of " +
                          size_text(map[0].size()) + ": all need one size");
  }
  cv::Mat rectified;
  cv::remap(image, rectified, map[0], map[1], cv::INTER_LINEAR);
  return rectified;
}

}  // namespace egosgm::vision
