// SPDX-License-Identifier: Apache-2.0
#include "host/vision/odometry_features.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "host/cpu_clones.h"

namespace egosgm::vision::odometry {
namespace {

constexpr int kSuppressionRadius = 3;
constexpr int kRingRows = 8;  // a power of two that holds 2 * kSuppressionRadius + 1 rows
constexpr int kMargin = 9;    // the descriptor's reach, and one pixel of smoothing
constexpr int kCell = 64;

const std::uint8_t* view_row(const ImageView& image, int y) {
  return static_cast<const std::uint8_t*>(image.data) + image.stride_bytes * y;
}

// The row loops are functions of their own: the compiler vectorises over pointers that it knows to be apart, and it
// knows that of parameters only.

// Sums of three and of five rows, and the step between the upper and the lower two.
EGOSGM_CPU_CLONES
void sum_columns(const std::uint8_t* __restrict a, const std::uint8_t* __restrict b, const std::uint8_t* __restrict c,
                 const std::uint8_t* __restrict d, const std::uint8_t* __restrict e, std::uint16_t* __restrict column3,
                 std::uint16_t* __restrict column5, std::int16_t* __restrict step, int width) {
  for (int x = 0; x < width; ++x) {
    const std::uint16_t inner = b[x] + c[x] + d[x];
    column3[x] = inner;
    column5[x] = inner + a[x] + e[x];
    step[x] = static_cast<std::int16_t>(a[x] + b[x] - d[x] - e[x]);
  }
}

// Blob: 2 box3 + 7 centre - box5; corner: the step's difference from left to right; smoothed: box3 / 9.
EGOSGM_CPU_CLONES
void filter_columns(const std::uint16_t* __restrict column3, const std::uint16_t* __restrict column5,
                    const std::int16_t* __restrict step, const std::uint8_t* __restrict centre,
                    std::int16_t* __restrict blob, std::int16_t* __restrict corner, std::uint8_t* __restrict smooth,
                    int width) {
  for (int x = 2; x < width - 2; ++x) {
    const std::uint16_t box3 = column3[x - 1] + column3[x] + column3[x + 1];
    const std::uint16_t box5 = column5[x - 2] + column5[x - 1] + column5[x] + column5[x + 1] + column5[x + 2];
    blob[x] = static_cast<std::int16_t>(2 * box3 + 7 * centre[x] - box5);
    corner[x] = static_cast<std::int16_t>(step[x - 2] + step[x - 1] - step[x + 1] - step[x + 2]);
    smooth[x] = static_cast<std::uint8_t>(static_cast<std::uint16_t>((box3 >> 1) * 57) >> 8);
  }
}

using Row = const std::int16_t* __restrict;

EGOSGM_CPU_CLONES
void column_maxima(Row a, Row b, Row c, Row d, Row e, Row f, Row g, std::int16_t* __restrict out, int width) {
  for (int x = 0; x < width; ++x) {
    out[x] = std::max(std::max(std::max(a[x], b[x]), std::max(c[x], d[x])), std::max(std::max(e[x], f[x]), g[x]));
  }
}

EGOSGM_CPU_CLONES
void column_minima(Row a, Row b, Row c, Row d, Row e, Row f, Row g, std::int16_t* __restrict out, int width) {
  for (int x = 0; x < width; ++x) {
    out[x] = std::min(std::min(std::min(a[x], b[x]), std::min(c[x], d[x])), std::min(std::min(e[x], f[x]), g[x]));
  }
}

// Extrema over x - 3 .. x + 3.
EGOSGM_CPU_CLONES
void row_extrema(const std::int16_t* __restrict in, std::int16_t* __restrict maxima, std::int16_t* __restrict minima,
                 int width) {
  for (int x = kSuppressionRadius; x < width - kSuppressionRadius; ++x) {
    const std::int16_t high = std::max(std::max(std::max(in[x - 3], in[x - 2]), std::max(in[x - 1], in[x])),
                                       std::max(std::max(in[x + 1], in[x + 2]), in[x + 3]));
    const std::int16_t low = std::min(std::min(std::min(in[x - 3], in[x - 2]), std::min(in[x - 1], in[x])),
                                      std::min(std::min(in[x + 1], in[x + 2]), in[x + 3]));
    maxima[x] = high;
    minima[x] = low;
  }
}

// Bit 0: a maximum, bit 1: a minimum.
EGOSGM_CPU_CLONES
void flag_extrema(const std::int16_t* __restrict response, const std::int16_t* __restrict maxima,
                  const std::int16_t* __restrict minima, std::int16_t threshold, std::uint8_t* __restrict flags,
                  int width) {
  for (int x = 0; x < width; ++x) {
    const std::int16_t r = response[x];
    flags[x] = static_cast<std::uint8_t>(
        (((r == maxima[x]) & (r >= threshold)) | (((r == minima[x]) & (r <= -threshold)) << 1)));
  }
}

Descriptor describe(const GreyImage& smooth, int x, int y) {
  Descriptor descriptor;
  int sum = 0;
  for (int i = 0; i < 8; ++i) {
    const std::uint8_t* row = smooth.row(y - 7 + 2 * i) + x - 7;
    for (int j = 0; j < 8; ++j) {
      descriptor[8 * i + j] = row[2 * j];
      sum += row[2 * j];
    }
  }
  const int mean = (sum + kDescriptorSize / 2) / kDescriptorSize;
  int deviation = 0;
  for (int i = 0; i < kDescriptorSize; ++i) deviation += std::abs(descriptor[i] - mean);
  // 24 levels a mean deviation; below four grey levels contrast is not raised further: it is noise.
  const int gain = 24 * kDescriptorSize * 256 / std::max(deviation, 4 * kDescriptorSize);
  for (int i = 0; i < kDescriptorSize; ++i) {
    descriptor[i] = static_cast<std::uint8_t>(std::clamp(128 + (((descriptor[i] - mean) * gain) >> 8), 0, 255));
  }
  return descriptor;
}

}  // namespace

int max_value(const ImageView& image) {
  int largest = 0;
  for (int y = 0; y < image.height; ++y) {
    const auto* row = reinterpret_cast<const std::uint16_t*>(view_row(image, y));
    std::uint16_t row_largest = 0;
    for (int x = 0; x < image.width; ++x) row_largest = std::max(row_largest, row[x]);
    largest = std::max<int>(largest, row_largest);
  }
  return largest;
}

void to_grey(const ImageView& image, int shift, GreyImage& grey) {
  grey.width = image.width;
  grey.height = image.height;
  grey.pixels.resize(static_cast<std::size_t>(image.width) * image.height);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* source = view_row(image, y);
    if (image.type == PixelType::kU8) {
      std::memcpy(grey.row(y), source, image.width);
      continue;
    }
    const auto* wide = reinterpret_cast<const std::uint16_t*>(source);
    std::uint8_t* row = grey.row(y);
    for (int x = 0; x < image.width; ++x) row[x] = static_cast<std::uint8_t>(wide[x] >> shift);
  }
}

void FeatureDetector::filter_row(const GreyImage& image, int y) {
  const int width = image.width;
  const std::size_t ring = static_cast<std::size_t>(y % kRingRows) * width;
  sum_columns(image.row(y - 2), image.row(y - 1), image.row(y), image.row(y + 1), image.row(y + 2), column3_.data(),
              column5_.data(), column_step_.data(), width);
  filter_columns(column3_.data(), column5_.data(), column_step_.data(), image.row(y), response_[0].data() + ring,
                 response_[1].data() + ring, smooth_.row(y), width);
  for (int f = 0; f < 2; ++f) {
    row_extrema(response_[f].data() + ring, row_max_[f].data() + ring, row_min_[f].data() + ring, width);
  }
}

void FeatureDetector::suppress_row(int y, int threshold, int width) {
  const auto ring = [width](int row) { return static_cast<std::size_t>(row % kRingRows) * width; };
  for (int f = 0; f < 2; ++f) {
    const std::int16_t *high = row_max_[f].data(), *low = row_min_[f].data();
    column_maxima(high + ring(y - 3), high + ring(y - 2), high + ring(y - 1), high + ring(y), high + ring(y + 1),
                  high + ring(y + 2), high + ring(y + 3), maximum_.data(), width);
    column_minima(low + ring(y - 3), low + ring(y - 2), low + ring(y - 1), low + ring(y), low + ring(y + 1),
                  low + ring(y + 2), low + ring(y + 3), minimum_.data(), width);
    const std::int16_t* response = response_[f].data() + ring(y);
    flag_extrema(response, maximum_.data(), minimum_.data(), static_cast<std::int16_t>(threshold), flags_.data(),
                 width);
    for (int x0 = kMargin; x0 < width - kMargin; x0 += 8) {
      std::uint64_t word;
      std::memcpy(&word, flags_.data() + x0, sizeof(word));
      if (word == 0) continue;
      for (int x = x0; x < std::min(x0 + 8, width - kMargin); ++x) {
        if (flags_[x] == 0) continue;
        const int feature_class = 2 * f + (flags_[x] == 1 ? 0 : 1);
        found_[feature_class].push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y),
                                         static_cast<std::int16_t>(std::abs(response[x]))});
      }
    }
  }
}

// Marks what is not kept with strength 0; ties go to the upper and left.
void FeatureDetector::keep_strongest(int per_cell, int width, int height) {
  const int columns = (width + kCell - 1) / kCell, rows = (height + kCell - 1) / kCell;
  cells_.resize(static_cast<std::size_t>(columns) * rows);
  for (auto& found : found_) {
    for (auto& cell : cells_) cell.clear();
    for (int i = 0; i < static_cast<int>(found.size()); ++i) {
      cells_[(found[i].y / kCell) * columns + found[i].x / kCell].push_back(i);
    }
    const auto stronger = [&found](int a, int b) {
      return found[a].strength != found[b].strength ? found[a].strength > found[b].strength : a < b;
    };
    for (auto& cell : cells_) {
      const std::size_t limit = std::max(1, per_cell / kFeatureClasses);
      if (cell.size() <= limit) continue;
      std::nth_element(cell.begin(), cell.begin() + limit, cell.end(), stronger);
      for (std::size_t i = limit; i < cell.size(); ++i) found[cell[i]].strength = 0;
    }
  }
}

void FeatureDetector::detect(const GreyImage& image, int threshold, int per_cell, FeatureSet& set) {
  const int width = image.width, height = image.height;
  set.height = height;
  set.features.clear();
  set.classes.clear();
  set.descriptors.clear();
  set.row_begin.assign(kFeatureClasses * (height + 1), 0);
  if (width <= 2 * kMargin || height <= 2 * kMargin) return;

  smooth_.width = width;
  smooth_.height = height;
  smooth_.pixels.resize(static_cast<std::size_t>(width) * height);
  column5_.resize(width);
  column3_.resize(width);
  column_step_.resize(width);
  for (int f = 0; f < 2; ++f) {
    for (auto* rows : {&response_[f], &row_max_[f], &row_min_[f]}) rows->assign(kRingRows * width, 0);
  }
  maximum_.resize(width);
  minimum_.resize(width);
  flags_.resize(width + 8);
  for (auto& found : found_) found.clear();

  for (int y = 2; y < height - 2; ++y) {
    filter_row(image, y);
    const int complete = y - kSuppressionRadius;
    if (complete >= kMargin && complete < height - kMargin) suppress_row(complete, threshold, width);
  }
  keep_strongest(per_cell, width, height);

  for (int c = 0; c < kFeatureClasses; ++c) {
    int* row_begin = set.row_begin.data() + c * (height + 1);
    int row = 0;
    for (const Feature& feature : found_[c]) {
      if (feature.strength == 0) continue;
      for (; row <= feature.y; ++row) row_begin[row] = set.size();
      set.features.push_back(feature);
      set.classes.push_back(static_cast<std::uint8_t>(c));
      set.descriptors.push_back(describe(smooth_, feature.x, feature.y));
    }
    for (; row <= height; ++row) row_begin[row] = set.size();
  }
}

}  // namespace egosgm::vision::odometry
