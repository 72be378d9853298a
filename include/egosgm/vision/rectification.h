// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"

namespace egosgm::vision {

/// Two cameras as they were calibrated: OpenCV's model of lenses, or its fisheye model. A point of the left camera's
/// frame lies at R x + T in the right one's. All matrices are CV_64F.
struct StereoRig {
  struct Camera {
    cv::Mat matrix;      // 3x3 [px]
    cv::Mat distortion;  // 4, 5, 8, 12 or 14 coefficients, 4 of a fisheye
  };
  Camera left, right;
  bool is_fisheye = false;          // both: cv::fisheye, "equidistant" elsewhere
  cv::Mat R, T;                     // 3x3, 3x1 [m]
  std::optional<cv::Size> size;     // of the images that were calibrated [px], where it is known
  std::optional<cv::Mat> given[4];  // R1, R2 (3x3), P1, P2 (3x4) that are to be used, all or none
};

/// Reads what OpenCV's stereo calibrations write (YAML, XML or JSON): M1 (or K1, cameraMatrix1, ...), D1, M2, D2, R, T,
/// or a pair of files, intrinsics.yml and extrinsics.yml, in one folder; also R1, R2, P1, P2. `unit_m`: metres in a
/// unit of T. `is_fisheye`: D1 and D2 are those of cv::fisheye, which writes the same names. Nothing where the file is
/// none of that kind. Throws InvalidArgument, naming the file and what is missing. Thread-safe.
EGOSGM_EXPORT std::optional<StereoRig> read_opencv_rig(const std::filesystem::path& file, double unit_m = 1,
                                                       bool is_fisheye = false);

/// Reads cam0/sensor.yaml and cam1/sensor.yaml in `mav0` of an EuRoC sequence. Throws InvalidArgument, naming the file.
/// Thread-safe.
EGOSGM_EXPORT StereoRig read_euroc_rig(const std::filesystem::path& mav0);

/// How raw images become rectified ones.
struct Rectification {
  Calibration calibration;            // of the rectified images
  cv::Mat left_map[2], right_map[2];  // of cv::remap, CV_32FC1: where each rectified pixel lies in the raw image [px]
  cv::Mat valid;                      // CV_8UC1: 255 where the rectified left pixel lies in the raw image
  cv::Rect valid_left, valid_right;   // largest rectangles of such pixels [px]
};

/// `size`: of the raw images and the rectified ones [px]. `alpha` 0: only pixels that the raw images have, to 1: all
/// that they have. Throws InvalidArgument where a matrix has another shape, a rotation is none, the cameras do not
/// stand side by side, left and right are swapped, or the images have another size than was calibrated. Thread-safe.
EGOSGM_EXPORT Rectification rectification_of(const StereoRig& rig, cv::Size size, double alpha = 0);

/// The rectified image of the same type, by one of the Rectification's maps; bilinear, black where the raw image has
/// nothing. Throws InvalidArgument unless the image has the maps' size. Thread-safe.
EGOSGM_EXPORT cv::Mat rectify(const cv::Mat& image, const cv::Mat (&map)[2]);

/// The same point in both images of a pair [px].
struct PairMatch {
  cv::Point2f left, right;
};

/// Points found in both images, wherever they lie: nothing is assumed of rows, of sides or of the range of disparities.
/// Matched by ORB, outliers dropped by a fundamental matrix, refined to a part of a pixel. Throws InvalidArgument
/// unless both are CV_8UC1 or CV_16UC1 of one size. Deterministic. Thread-safe.
EGOSGM_EXPORT std::vector<PairMatch> match_pair(const cv::Mat& left, const cv::Mat& right);

}  // namespace egosgm::vision
