// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>

#include "egosgm/calibration.h"

namespace egosgm::app {

/// Two cameras as they were calibrated: OpenCV's model of lenses, or its fisheye model, where a point of the left
/// camera's frame lies at R x + T in the right one's.
struct StereoRig {
  struct Camera {
    cv::Mat matrix, distortion;  // 3x3; 4 to 14 coefficients, 4 of a fisheye
  };
  Camera left, right;
  bool is_fisheye = false;          // both: cv::fisheye, "equidistant" elsewhere
  cv::Mat R, T;                     // 3x3, 3x1 in metres
  std::optional<cv::Size> size;     // of the images that were calibrated, where the file says so
  std::optional<cv::Mat> given[4];  // R1, R2, P1, P2, where the file has them all
};

/// Reads what OpenCV's stereo calibrations write (YAML, XML or JSON): M1 (or K1, cameraMatrix1, ...), D1, M2, D2, R, T,
/// or a pair of files, intrinsics.yml and extrinsics.yml, in one folder; also R1, R2, P1, P2. `unit_m`: metres in a
/// unit of T. `is_fisheye`: D1 and D2 are those of cv::fisheye, which writes the same names. Nothing where the file is
/// none of that kind. Throws InvalidArgument, naming the file and what is missing.
std::optional<StereoRig> read_opencv_rig(const std::filesystem::path& file, double unit_m, bool is_fisheye);

/// Reads mav0/cam0/sensor.yaml and mav0/cam1/sensor.yaml of an EuRoC sequence. Throws InvalidArgument.
StereoRig read_euroc_rig(const std::filesystem::path& mav0);

/// How raw images become rectified ones.
struct Rectification {
  Calibration calibration;
  cv::Mat left_map[2], right_map[2];  // of cv::remap
  cv::Mat valid;                      // CV_8UC1: 255 where the rectified left pixel lies in the raw image
  cv::Rect valid_left, valid_right;   // largest rectangles of such pixels
};

/// `alpha` 0: only pixels that the raw images have, to 1: all that they have. Throws InvalidArgument where the cameras
/// do not stand side by side, left and right are swapped, or the images have another size than was calibrated.
Rectification rectification_of(const StereoRig& rig, cv::Size size, double alpha);

}  // namespace egosgm::app
