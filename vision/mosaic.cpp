// SPDX-License-Identifier: Apache-2.0
#include "vision/mosaic.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "host/quantile.h"

namespace egosgm::vision {
namespace {

constexpr int kBlock = 32;
constexpr double kLeastBrightness = 4;  // of a block, so that noise in the dark is no colour
// Of the brightness, in the median of all blocks. Grey images of KITTI, Middlebury and others have 0.02 and less; their
// mosaics 0.1 and more, also where one colour is only a tenth brighter than the others.
constexpr double kLeastDifference = 0.04;
constexpr std::size_t kFewestValues = 9;  // of an image; one that dithers fewer differs from pixel to pixel, too

/// By how much the columns of a block differ, in its even or in its odd rows, as a share of its brightness. Its rows
/// must differ as much: else it has stripes, as sensors make them. 0 where pixels of one colour differ so much that it
/// may be noise.
double difference_in(const Image& grey, int top, int left) {
  double sums[2][2] = {}, steps = 0;  // of even and odd rows and columns; between pixels of one colour
  for (int y = 0; y < kBlock; ++y) {
    const std::uint8_t* row = grey.row(top + y) + left;
    for (int x = 0; x < kBlock; ++x) sums[y % 2][x % 2] += row[x];
    for (int x = 2; x < kBlock; ++x) steps += std::abs(row[x] - row[x - 2]);
  }
  constexpr double kPixels = kBlock * kBlock / 4.0;
  const double brightness = (sums[0][0] + sums[0][1] + sums[1][0] + sums[1][1]) / (4 * kPixels);
  const double columns = std::max(std::abs(sums[0][0] - sums[0][1]), std::abs(sums[1][0] - sums[1][1]));
  const double rows = std::max(std::abs(sums[0][0] - sums[1][0]), std::abs(sums[0][1] - sums[1][1]));
  const double difference = std::min(columns, rows) / kPixels;
  const double noise = 2 * steps / (kBlock * (kBlock - 2)) / std::sqrt(kPixels);  // of the means of white noise
  return difference > noise ? difference / std::max(kLeastBrightness, brightness) : 0;
}

/// How much neighbours in a row differ, as a share of how much all pixels do; 0 where these are alike.
double roughness(const Image& grey, bool swapped) {
  double sum = 0, squares = 0, steps = 0;
  for (int y = 0; y < grey.rows; ++y) {
    double before = 0;
    for (int x = 0; x < grey.cols; ++x) {
      const std::uint16_t pixel = grey.at<std::uint16_t>(y, x);
      const double value = swapped ? static_cast<std::uint16_t>(pixel << 8 | pixel >> 8) : pixel;
      if (x > 0) steps += std::abs(value - before);
      sum += value, squares += value * value, before = value;
    }
  }
  const auto pixels = static_cast<double>(grey.pixels());
  const double variance = squares / pixels - sum * sum / (pixels * pixels);
  return variance > 0 ? steps / pixels / std::sqrt(variance) : 0;
}

}  // namespace

bool holds_swapped_bytes(const Image& grey) {
  constexpr double kMuchRougher = 2;  // natural images are 3 times and more; of noise, both orders are alike
  return grey.type.channel == ChannelType::kU16 && roughness(grey, false) > kMuchRougher * roughness(grey, true);
}

bool holds_mosaic(const Image& grey) {
  std::bitset<256> values;
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) values.set(grey.at<std::uint8_t>(y, x));
  }
  if (values.count() < kFewestValues) return false;
  std::vector<double> differences;
  for (int y = 0; y + kBlock <= grey.rows; y += kBlock) {
    for (int x = 0; x + kBlock <= grey.cols; x += kBlock) differences.push_back(difference_in(grey, y, x));
  }
  return !differences.empty() && median(std::move(differences)) > kLeastDifference;
}

}  // namespace egosgm::vision
