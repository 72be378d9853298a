// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/point_cloud.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>

#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/render.h"
#include "vision/file_io.h"

namespace egosgm::vision {
namespace {

static_assert(std::endian::native == std::endian::little, "write_ply writes the host's bytes as little endian");

void require(bool fits, const char* what) {
  if (!fits) throw InvalidArgument(std::string("point cloud: ") + what);
}

void require_positive(const char* name, double value) {
  if (value > 0) return;
  throw InvalidArgument(std::string("point cloud: ") + name + " is " + std::to_string(value) +
                        ": choose a positive number");
}

bool has_neighbour_within(const Image& disparity, int x, int y, float max_jump_px) {
  const float d = disparity.at<float>(y, x);
  const auto near = [&](int u, int v) {
    if (u < 0 || v < 0 || u >= disparity.cols || v >= disparity.rows) return false;
    const float n = disparity.at<float>(v, u);
    return is_valid_disparity(n) && std::abs(n - d) <= max_jump_px;
  };
  return near(x - 1, y) || near(x + 1, y) || near(x, y - 1) || near(x, y + 1);
}

}  // namespace

void PointCloudOptions::validate() const {
  require_positive("max_relative_sigma", max_relative_sigma);
  require_positive("max_depth_m", max_depth_m);
  require_positive("max_jump_px", max_jump_px);
}

PointCloud point_cloud(const Image& disparity, const Image& variance, const Image& colors,
                       const Calibration& calibration, const PointCloudOptions& options, const Image& reasons) {
  require(!disparity.empty() && disparity.type == kF32 && variance.type == kF32,
          "disparity and variance must be float32");
  require(disparity.size() == variance.size() && disparity.size() == colors.size(),
          "disparity, variance and image must have one size");
  const bool judges_reasons = !options.reasons.empty();
  require(!judges_reasons || (reasons.type == kU8 && reasons.size() == disparity.size()),
          "a choice of reasons needs their map, uint8, of the disparity's size");
  options.validate();
  calibration.validate();
  std::array<bool, 256> stays{};
  for (const Reason reason : options.reasons) stays[static_cast<std::uint8_t>(reason)] = true;
  const Image picture = colors.type == kBgr8 ? colors : color_grey(colors);
  PointCloud cloud;
  cloud.points_m.reserve(disparity.pixels());
  cloud.colors.reserve(disparity.pixels());
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      const float d = disparity.at<float>(y, x);
      const double shift_px = d + calibration.doffs_px;
      if (!is_valid_disparity(d)) continue;
      const double depth_m = calibration.fx * calibration.baseline_m / shift_px;
      const double relative_sigma = std::sqrt(variance.at<float>(y, x)) / shift_px;
      std::int64_t* const why = !(shift_px > 0 && depth_m <= options.max_depth_m)          ? &cloud.left_out.far
                                : !(relative_sigma <= options.max_relative_sigma)          ? &cloud.left_out.uncertain
                                : judges_reasons && !stays[reasons.at<std::uint8_t>(y, x)] ? &cloud.left_out.reason
                                : !has_neighbour_within(disparity, x, y, static_cast<float>(options.max_jump_px))
                                    ? &cloud.left_out.alone
                                    : nullptr;
      if (why) {
        ++*why;
        continue;
      }
      cloud.points_m.push_back({static_cast<float>((x - calibration.cx) / calibration.fx * depth_m),
                                static_cast<float>((y - calibration.cy) / calibration.fy * depth_m),
                                static_cast<float>(depth_m)});
      cloud.colors.push_back(picture.at<Color>(y, x));
    }
  }
  return cloud;
}

void write_ply(const std::filesystem::path& file, const PointCloud& cloud) {
  const std::size_t count = cloud.points_m.size();
  const bool has_normals = !cloud.normals.empty(), has_colors = !cloud.colors.empty();
  require(!has_normals || cloud.normals.size() == count, "as many normals as points are needed");
  require(!has_colors || cloud.colors.size() == count, "as many colours as points are needed");
  std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment EgoSGM: x right, y down, z forward, metres\n";
  bytes += "element vertex " + std::to_string(count) + "\nproperty float x\nproperty float y\nproperty float z\n";
  if (has_normals) bytes += "property float nx\nproperty float ny\nproperty float nz\n";
  if (has_colors) bytes += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  bytes += "end_header\n";
  constexpr std::size_t kVectorBytes = 3 * sizeof(float);
  const std::size_t header_bytes = bytes.size();
  bytes.resize(header_bytes + count * (kVectorBytes + (has_normals ? kVectorBytes : 0) + (has_colors ? 3 : 0)));
  char* next = bytes.data() + header_bytes;
  const auto put = [&next](float x, float y, float z) {
    const float vector[3] = {x, y, z};
    std::memcpy(next, vector, kVectorBytes);
    next += kVectorBytes;
  };
  for (std::size_t i = 0; i < count; ++i) {
    put(cloud.points_m[i][0], cloud.points_m[i][1], cloud.points_m[i][2]);
    if (has_normals) put(cloud.normals[i][0], cloud.normals[i][1], cloud.normals[i][2]);
    for (int channel = 2; has_colors && channel >= 0; --channel)
      *next++ = static_cast<char>(cloud.colors[i][static_cast<std::size_t>(channel)]);
  }
  write_file(file, bytes);
}

std::int64_t write_depth_png(const std::filesystem::path& file, const Image& depth_m) {
  require(!depth_m.empty() && depth_m.type == kF32, "a depth map must be float32");
  constexpr float kStepsPerMetre = 1000.0f;
  Image stored(depth_m.size(), kU16, 0);
  std::int64_t not_stored = 0;
  for (int y = 0; y < depth_m.rows; ++y) {
    const auto* depths = depth_m.row<float>(y);
    auto* row = stored.row<std::uint16_t>(y);
    for (int x = 0; x < depth_m.cols; ++x) {
      if (!is_valid_disparity(depths[x]) || depths[x] <= 0) continue;
      const float steps = std::max(depths[x] * kStepsPerMetre + 0.5f, 1.0f);
      if (steps < 65536.0f) {
        row[x] = static_cast<std::uint16_t>(steps);
      } else {
        ++not_stored;
      }
    }
  }
  write_png(file, stored);
  return not_stored;
}

}  // namespace egosgm::vision
