// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "egosgm/image.h"
#include "host/grey_levels.h"

namespace egosgm::odometry {

/// The working copy of a frame: 8 bit, rows `width` apart.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;

  const std::uint8_t* row(int y) const { return pixels.data() + static_cast<std::size_t>(y) * width; }
  std::uint8_t* row(int y) { return pixels.data() + static_cast<std::size_t>(y) * width; }
};

/// `image` as 8 bit; values of 16 bits become so by `levels`.
void to_grey(const ImageView& image, const GreyLevels& levels, GreyImage& grey);

/// Means of 2x2 pixels. An odd last row or column is left out.
void halve(const GreyImage& image, GreyImage& half);

enum FeatureClass : int { kBlobMax, kBlobMin, kCornerMax, kCornerMin, kFeatureClasses };

struct Feature {
  std::int16_t x = 0;
  std::int16_t y = 0;
  std::int16_t strength = 0;  // |response|
};

/// 8x8 samples of the smoothed image, two pixels apart, free of mean and contrast.
inline constexpr int kDescriptorSize = 64;
using Descriptor = std::array<std::uint8_t, kDescriptorSize>;

/// Features of one image, sorted by class, row and column. Class c's features of row y are
/// [row_begin[c * (height + 1) + y], row_begin[c * (height + 1) + y + 1]).
struct FeatureSet {
  int height = 0;
  std::vector<Feature> features;
  std::vector<std::uint8_t> classes;
  std::vector<int> row_begin;
  std::vector<Descriptor> descriptors;

  int size() const { return static_cast<int>(features.size()); }
  int first_of_row(int feature_class, int y) const { return row_begin[feature_class * (height + 1) + y]; }
};

/// Makes features of an image at half the size those of the image, which has `height` rows.
void enlarge(FeatureSet& set, int height);

/// Extrema of the 5x5 blob and corner filters of Geiger et al. (StereoScan, IV 2011), each the only one of its
/// class within two pixels. Keeps its rows between calls.
class FeatureDetector {
 public:
  /// REQUIRES: `threshold` > 0. Keeps the `per_cell` strongest of every 64x64 cell.
  void detect(const GreyImage& image, int threshold, int per_cell, FeatureSet& set);

 private:
  struct Responses;
  void filter_row(const GreyImage& image, int y);
  void suppress_rows(int y, int width, int height);
  void keep_strongest(int filter, const std::int16_t* response, int y, int width, std::vector<std::uint8_t>& flags);

  GreyImage smooth_;
  std::vector<std::uint16_t> column5_, column3_;
  std::vector<std::int16_t> column_step_;
  std::vector<std::int16_t> response_[2], row_max_[2], row_min_[2];  // rings of rows: blob, corner
  std::vector<std::uint8_t> flags_[2];                               // of two rows
  std::vector<Feature> found_[kFeatureClasses];  // those of strength 0 were replaced by stronger ones
  // The present row of cells: strengths and complements of indices, in full cells the weakest first.
  std::vector<std::vector<std::uint64_t>> cells_[kFeatureClasses];
  std::vector<std::int16_t> least_[kFeatureClasses];  // strength that a column still asks for
  std::size_t per_cell_ = 0;
};

/// Sum of absolute differences.
inline int descriptor_distance(const Descriptor& a, const Descriptor& b) {
  int sum = 0;
  for (int i = 0; i < kDescriptorSize; ++i) sum += std::abs(a[i] - b[i]);
  return sum;
}

}  // namespace egosgm::odometry
