// SPDX-License-Identifier: Apache-2.0
#include "host/vision/coarse_map.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "host/vision/grey_bytes.h"

namespace egosgm::vision {
namespace {

constexpr double kClippedShare = 0.01;  // of the points
constexpr int kCoarseWidth = 256;       // images are made smaller, down to this
constexpr double kFewest = 0.03;        // of the pixels; below, the map says nothing
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

/// The mean difference [grey levels] of the block around (x, y) and the one `d` to the left in the other image.
double block_difference(const cv::Mat& left, const cv::Mat& right, int x, int y, int d) {
  constexpr int kRadius = 3;
  int sum = 0, count = 0;
  for (int v = std::max(0, y - kRadius); v <= std::min(left.rows - 1, y + kRadius); ++v) {
    for (int u = std::max({0, x - kRadius, d}); u <= std::min({left.cols - 1, x + kRadius, right.cols - 1 + d}); ++u) {
      // To what lies between the neighbours, as a disparity falls between pixels (Birchfield and Tomasi).
      const auto* row = right.ptr(v);
      const int here = row[u - d], before = (here + row[std::max(u - d - 1, 0)]) / 2,
                after = (here + row[std::min(u - d + 1, right.cols - 1)]) / 2;
      const int value = left.at<std::uint8_t>(v, u);
      sum += std::max({0, value - std::max({here, before, after}), std::min({here, before, after}) - value});
      ++count;
    }
  }
  return count == 0 ? 255.0 : static_cast<double>(sum) / count;
}

/// Whether a disparity in [least, end) explains the images nearly as well as `d`.
bool is_ambiguous(const cv::Mat& left, const cv::Mat& right, int x, int y, int d, int least, int end) {
  constexpr double kNoise = 3;  // grey levels
  const double enough = 1.5 * block_difference(left, right, x, y, d) + kNoise;
  for (int other = std::max(least, x - right.cols + 1); other < std::min(end, x + 1); ++other) {
    if (block_difference(left, right, x, y, other) <= enough) return true;
  }
  return false;
}

/// As coarse_map, of bytes.
cv::Mat coarse_map_of(const cv::Mat& left, const cv::Mat& right, double row_offset_px, int least, int end) {
  const int factor = std::max(1, (left.cols + kCoarseWidth - 1) / kCoarseWidth);
  const cv::Size size(left.cols / factor, left.rows / factor);
  cv::Mat map(std::max(size.height, 0), std::max(size.width, 0), CV_32FC1, cv::Scalar(kNothing));
  if (size.width < 32 || size.height < 16) return map;
  const int half = (size.width / 2 + 15) / 16 * 16;
  cv::Mat small[2], wide[2], found;
  const cv::Mat back = (cv::Mat_<double>(2, 3) << 1, 0, 0, 0, 1, -row_offset_px);
  cv::Mat aligned;
  cv::warpAffine(right, aligned, back, right.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  for (int i = 0; i < 2; ++i) {
    cv::resize(i == 0 ? left : aligned, small[i], size, 0, 0, cv::INTER_AREA);
    cv::copyMakeBorder(small[i], wide[i], 0, 0, half, half, cv::BORDER_CONSTANT, cv::Scalar(0));
  }
  constexpr int kBlock = 5;
  const auto matcher = cv::StereoSGBM::create(-half, 2 * half, kBlock, 8 * kBlock * kBlock, 32 * kBlock * kBlock,
                                              /*disp12MaxDiff=*/1, /*preFilterCap=*/31, /*uniquenessRatio=*/15,
                                              /*speckleWindowSize=*/40, /*speckleRange=*/1);
  matcher->compute(wide[0], wide[1], found);
  cv::Mat edges;
  cv::Sobel(small[0], edges, CV_16S, 1, 0);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const float d = static_cast<float>(found.at<std::int16_t>(y, x + half)) / 16;
      const bool is_sure = d > static_cast<float>(-half) - 0.5f && std::abs(edges.at<std::int16_t>(y, x)) >= 24;
      if (!is_sure || x - d < 0 || x - d >= static_cast<float>(size.width)) continue;
      const float full = d * static_cast<float>(factor);
      const bool is_outside = full < static_cast<float>(least) - 1 || full > static_cast<float>(end);
      if (is_outside &&
          is_ambiguous(small[0], small[1], x, y, static_cast<int>(std::lround(d)), least / factor, end / factor)) {
        continue;
      }
      map.at<float>(y, x) = full;
    }
  }
  return map;
}

}  // namespace

cv::Mat coarse_map(const cv::Mat& left, const cv::Mat& right, double row_offset_px, int least, int end) {
  const auto [left_bytes, right_bytes] = bytes_of(left, right);
  return coarse_map_of(left_bytes, right_bytes, row_offset_px, least, end);
}

std::optional<Clipped> clipped_by_range(const cv::Mat& left, const cv::Mat& right, int least, int end) {
  const cv::Mat map = coarse_map(left, right, 0, least, end);
  std::vector<float> disparities;
  std::copy_if(map.begin<float>(), map.end<float>(), std::back_inserter(disparities),
               [](float d) { return std::isfinite(d); });
  if (disparities.empty() || static_cast<double>(disparities.size()) < kFewest * static_cast<double>(map.total())) {
    return std::nullopt;
  }
  const auto above = std::count_if(disparities.begin(), disparities.end(), [&](float d) { return d > end - 1; });
  const double share = static_cast<double>(above) / static_cast<double>(disparities.size());
  if (share <= kClippedShare) return std::nullopt;
  const auto high = disparities.begin() + std::lround(0.995 * static_cast<double>(disparities.size() - 1));
  std::nth_element(disparities.begin(), high, disparities.end());
  return Clipped{share, 16 * static_cast<int>(std::ceil((1.1 * *high - least + 1) / 16))};
}

}  // namespace egosgm::vision
