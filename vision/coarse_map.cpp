// SPDX-License-Identifier: Apache-2.0
#include "vision/coarse_map.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "host/quantile.h"
#include "vision/grey_bytes.h"
#include "vision/no_value.h"
#include "vision/wide_matching.h"

namespace egosgm::vision {
namespace {

constexpr double kClippedShare = 0.01;  // of the points
constexpr int kBeyond_px = 2;           // noise of what lies where the range begins
constexpr int kLeastSlope = 24;         // of grey levels; where rows are smoother, nothing is sure
constexpr int kCoarseSide = 256;        // images are made smaller, down to this
constexpr double kFewest = 0.03;        // of the pixels; below, the map says nothing

/// The mean difference [grey levels] of the block around (x, y) and the one `d` to the left in the other image.
double block_difference(const Image& left, const Image& right, int x, int y, int d) {
  constexpr int kRadius = 3;
  int sum = 0, count = 0;
  for (int v = std::max(0, y - kRadius); v <= std::min(left.rows - 1, y + kRadius); ++v) {
    for (int u = std::max({0, x - kRadius, d}); u <= std::min({left.cols - 1, x + kRadius, right.cols - 1 + d}); ++u) {
      // To what lies between the neighbours, as a disparity falls between pixels (Birchfield and Tomasi).
      const auto* row = right.row(v);
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
bool is_ambiguous(const Image& left, const Image& right, int x, int y, int d, int least, int end) {
  constexpr double kNoise = 3;  // grey levels
  const double enough = 1.5 * block_difference(left, right, x, y, d) + kNoise;
  for (int other = std::max(least, x - right.cols + 1); other < std::min(end, x + 1); ++other) {
    if (block_difference(left, right, x, y, other) <= enough) return true;
  }
  return false;
}

/// Across a column, as Sobel has it.
int slope_at(const Image& image, int x, int y) {
  int slope = 0;
  for (const auto& [v, weight] : {std::pair{-1, 1}, {0, 2}, {1, 1}}) {
    const std::uint8_t* row = image.row(std::clamp(y + v, 0, image.rows - 1));
    slope += weight * (row[std::min(x + 1, image.cols - 1)] - row[std::max(x - 1, 0)]);
  }
  return slope;
}

/// The coarse map of images of bytes.
Image coarse_map_of(const Image& left, const Image& right, double row_offset_px, int least, int end) {
  const int factor = std::max(1, (std::max(left.cols, left.rows) + kCoarseSide - 1) / kCoarseSide);
  const Size size{left.cols / factor, left.rows / factor};
  Image map(std::max(size.height, 0), std::max(size.width, 0), kF32, kNoValue);
  if (size.width < 32 || size.height < 16) return map;
  const int half = (size.width / 2 + 15) / 16 * 16;
  const Image small[2] = {shrunk_grey(left, factor, 0), shrunk_grey(right, factor, row_offset_px)};
  const Image found = match_widely(small[0], small[1], half);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const float d = found.at<float>(y, x);
      const bool is_sure = has_value(d) && std::abs(slope_at(small[0], x, y)) >= kLeastSlope;
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

Image coarse_map(const Image& left, const Image& right, double row_offset_px, int least, int end) {
  const auto [left_bytes, right_bytes] = bytes_of(left, right);
  return coarse_map_of(left_bytes, right_bytes, row_offset_px, least, end);
}

std::optional<Clipped> clipped_by_range(const Image& left, const Image& right, int least, int end) {
  const Image map = coarse_map(left, right, 0, least, end);
  std::vector<float> disparities;
  std::copy_if(map.row<float>(0), map.row<float>(0) + map.pixels(), std::back_inserter(disparities),
               [](float d) { return std::isfinite(d); });
  if (disparities.empty() || static_cast<double>(disparities.size()) < kFewest * static_cast<double>(map.pixels())) {
    return std::nullopt;
  }
  const auto share_of = [&](const auto& is_outside) {
    const auto count = std::count_if(disparities.begin(), disparities.end(), is_outside);
    const double share = static_cast<double>(count) / static_cast<double>(disparities.size());
    return share > kClippedShare ? share : 0;
  };
  const double near_share = share_of([&](float d) { return d > end - 1; });
  const double far_share = share_of([&](float d) { return d < least - kBeyond_px; });
  if (near_share == 0 && far_share == 0) return std::nullopt;
  const auto quantile = [&](double share) -> double {
    const auto at = static_cast<std::size_t>(std::lround(share * static_cast<double>(disparities.size() - 1)));
    return nth_value(disparities, at);
  };
  return Clipped{near_share, far_share, 16 * static_cast<int>(std::ceil((1.1 * quantile(0.995) - least + 1) / 16)),
                 static_cast<int>(std::floor(quantile(0.005))) - kBeyond_px};
}

}  // namespace egosgm::vision
