// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/reason.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Pixels with a disparity that became no points, by the first of the bounds that left them out.
struct LeftOut {
  std::int64_t far = 0;        // beyond max_depth_m, or at infinity and behind it: d + doffs <= 0
  std::int64_t uncertain = 0;  // max_relative_sigma
  std::int64_t reason = 0;     // one that is not among `reasons`
  std::int64_t alone = 0;      // max_jump_px
};

/// Points, and what belongs to each of them; colours and normals may be missing.
struct PointCloud {
  std::vector<std::array<float, 3>> points_m;
  std::vector<Color> colors{};  // BGR
  std::vector<std::array<float, 3>> normals{};
  LeftOut left_out{};
};

/// Which pixels become points. The standard deviation of a depth Z is sigma_Z = Z sqrt(p) / (d + doffs), p the
/// disparity's variance: it grows with the square of the depth, and so do the cones of noise behind every surface.
struct EGOSGM_EXPORT PointCloudOptions {
  double max_relative_sigma = 0.1;  // largest sigma_Z / Z
  double max_depth_m = 80.0;
  double max_jump_px = 1.0;       // a pixel whose disparity lies farther than this from all four neighbours is left out
  std::vector<Reason> reasons{};  // a pixel that has none of these is left out; empty: all may stay

  /// Throws InvalidArgument, naming the value, unless all are positive.
  void validate() const;
};

/// The points of a disparity map [px] with its variance [px^2], both kF32, in the left camera's frame (x right, y
/// down, z forward), row by row. `colors` is the left image, kU8, kU16 (stretched to its maximum) or kBgr8;
/// `reasons` are FrameOutputs::reason, kU8, which options.reasons needs. Throws InvalidArgument for other types,
/// for maps of different sizes, as Calibration::validate and as PointCloudOptions::validate. Thread-safe.
EGOSGM_EXPORT PointCloud point_cloud(const Image& disparity, const Image& variance, const Image& colors,
                                     const Calibration& calibration, const PointCloudOptions& options = {},
                                     const Image& reasons = {});

/// Writes a binary PLY (x, y, z as float [m]; nx, ny, nz as float and red, green, blue as uchar where there are any),
/// whole or not at all. Throws InvalidArgument unless there are as many of each as points, and IoError. Thread-safe for
/// different files.
EGOSGM_EXPORT void write_ply(const std::filesystem::path& file, const PointCloud& cloud);

/// Writes a depth map [m], kF32, as a 16-bit PNG of millimetres, 0 where there is none, as RGB-D data sets store
/// theirs (TUM's own have 5000 steps a metre, these 1000). Returns how many depths of 65.536 m and more it has no room
/// for; they become 0. Throws as write_png does. Thread-safe for different files.
EGOSGM_EXPORT std::int64_t write_depth_png(const std::filesystem::path& file, const Image& depth_m);

}  // namespace egosgm::vision
