// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"

namespace egosgm::vision {

/// Points in the left camera's frame (x right, y down, z forward), row by row, and their colours.
struct PointCloud {
  std::vector<cv::Point3f> points_m;
  std::vector<cv::Vec3b> colors;  // BGR
};

/// Which pixels become points. The standard deviation of a depth Z is sigma_Z = Z sqrt(p) / (d + doffs), p the
/// disparity's variance: it grows with the square of the depth, and so do the cones of noise behind every surface.
struct EGOSGM_EXPORT PointCloudOptions {
  double max_relative_sigma = 0.05;  // largest sigma_Z / Z
  double max_depth_m = 80.0;
  double max_jump_px = 1.0;  // a pixel whose disparity lies farther than this from all four neighbours is left out

  /// Throws InvalidArgument, naming the value, unless all are positive.
  void validate() const;
};

/// The points of a disparity map [px] with its variance [px^2], both CV_32FC1; `colors` is the left image, CV_8UC1,
/// CV_16UC1 (stretched to its maximum) or CV_8UC3. Throws InvalidArgument for other types, for maps of different sizes,
/// and as PointCloudOptions::validate does. Thread-safe.
EGOSGM_EXPORT PointCloud point_cloud(const cv::Mat& disparity, const cv::Mat& variance, const cv::Mat& colors,
                                     const Calibration& calibration, const PointCloudOptions& options = {});

/// Writes a binary PLY (x, y, z as float [m]; red, green, blue as uchar), whole or not at all. Throws IoError.
/// Thread-safe for different files.
EGOSGM_EXPORT void write_ply(const std::filesystem::path& file, const PointCloud& cloud);

/// Writes a depth map [m], CV_32FC1, as a 16-bit PNG of millimetres, 0 where there is none, as RGB-D data sets store
/// theirs (TUM's own have 5000 steps a metre, these 1000). Returns how many depths of 65.536 m and more it has no room
/// for; they become 0. Throws as write_png does. Thread-safe for different files.
EGOSGM_EXPORT std::int64_t write_depth_png(const std::filesystem::path& file, const cv::Mat& depth_m);

}  // namespace egosgm::vision
