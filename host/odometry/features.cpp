// SPDX-License-Identifier: Apache-2.0
#include "host/odometry/features.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "host/cpu_clones.h"

namespace egosgm::odometry {
namespace {

constexpr int kSuppressionRadius = 2;
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

// Extrema over x - 2 .. x + 2.
EGOSGM_CPU_CLONES
void row_extrema(const std::int16_t* __restrict in, std::int16_t* __restrict maxima, std::int16_t* __restrict minima,
                 int width) {
  for (int x = kSuppressionRadius; x < width - kSuppressionRadius; ++x) {
    const std::int16_t high = std::max(std::max(std::max(in[x - 2], in[x - 1]), std::max(in[x], in[x + 1])), in[x + 2]);
    const std::int16_t low = std::min(std::min(std::min(in[x - 2], in[x - 1]), std::min(in[x], in[x + 1])), in[x + 2]);
    maxima[x] = high;
    minima[x] = low;
  }
}

constexpr int kTwoRows = 2 * kSuppressionRadius + 2;  // around two rows below each other
static_assert(kTwoRows <= kRingRows && kCell % 2 == 0);
using RingRows = std::array<const std::int16_t*, kTwoRows>;

// Extrema of the two rows in the middle of `high` and `low`. Bit 0: a maximum of at least `above`, bit 1: a minimum of
// at most
// -`below`.
EGOSGM_CPU_CLONES
void flag_extrema(const std::int16_t* upper, const std::int16_t* lower, const RingRows& high, const RingRows& low,
                  const std::int16_t* above, const std::int16_t* below, std::uint8_t* __restrict upper_flags,
                  std::uint8_t* __restrict lower_flags, int width) {
  const auto [a, b, c, d, e, f] = high;
  const auto [i, j, k, l, m, n] = low;
  for (int x = 0; x < width; ++x) {
    std::int16_t most = std::max(std::max(b[x], c[x]), std::max(d[x], e[x]));
    std::int16_t least = std::min(std::min(j[x], k[x]), std::min(l[x], m[x]));
    most = std::max(most, above[x]);
    least = std::min(least, static_cast<std::int16_t>(-below[x]));
    const std::int16_t u = upper[x], v = lower[x];
    upper_flags[x] = static_cast<std::uint8_t>((u >= std::max(most, a[x])) | ((u <= std::min(least, i[x])) << 1));
    lower_flags[x] = static_cast<std::uint8_t>((v >= std::max(most, f[x])) | ((v <= std::min(least, n[x])) << 1));
  }
}

EGOSGM_CPU_CLONES
void halve_row(const std::uint8_t* __restrict upper, const std::uint8_t* __restrict lower, std::uint8_t* __restrict to,
               int width) {
  for (int x = 0; x < width; ++x) {
    to[x] = static_cast<std::uint8_t>((upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) >> 2);
  }
}

EGOSGM_CPU_CLONES
void describe(const GreyImage& smooth, int x, int y, Descriptor& descriptor) {
  std::uint8_t samples[kDescriptorSize];
  int sum = 0;
  for (int i = 0; i < 8; ++i) {
    const std::uint8_t* row = smooth.row(y - 7 + 2 * i) + x - 7;
    for (int j = 0; j < 8; ++j) {
      samples[8 * i + j] = row[2 * j];
      sum += row[2 * j];
    }
  }
  const int mean = (sum + kDescriptorSize / 2) / kDescriptorSize;
  int deviation = 0;
  for (int i = 0; i < kDescriptorSize; ++i) deviation += std::abs(samples[i] - mean);
  // 24 levels a mean deviation; below four grey levels contrast is not raised further: it is noise.
  const int gain = 24 * kDescriptorSize * 256 / std::max(deviation, 4 * kDescriptorSize);
  for (int i = 0; i < kDescriptorSize; ++i) {
    descriptor[i] = static_cast<std::uint8_t>(std::clamp(128 + (((samples[i] - mean) * gain) >> 8), 0, 255));
  }
}

}  // namespace

void to_grey(const ImageView& image, const GreyLevels& levels, GreyImage& grey) {
  grey.width = image.width;
  grey.height = image.height;
  grey.pixels.resize(static_cast<std::size_t>(image.width) * image.height);
  for (int y = 0; y < image.height; ++y) {
    const std::uint8_t* source = view_row(image, y);
    std::uint8_t* row = grey.row(y);
    if (image.type == PixelType::kU8) {
      if (levels == GreyLevels{}) {
        std::memcpy(row, source, image.width);
      } else {
        std::transform(source, source + image.width, row, levels);
      }
      continue;
    }
    for (int x = 0; x < image.width; ++x) {
      std::uint16_t wide;
      std::memcpy(&wide, source + 2 * x, sizeof(wide));  // it may lie at an odd place
      row[x] = levels(wide);
    }
  }
}

void halve(const GreyImage& image, GreyImage& half) {
  half.width = image.width / 2;
  half.height = image.height / 2;
  half.pixels.resize(static_cast<std::size_t>(half.width) * half.height);
  for (int y = 0; y < half.height; ++y) halve_row(image.row(2 * y), image.row(2 * y + 1), half.row(y), half.width);
}

void enlarge(FeatureSet& set, int height) {
  std::vector<int> row_begin(kFeatureClasses * (height + 1));
  for (int c = 0; c < kFeatureClasses; ++c) {
    for (int y = 0; y <= height; ++y) {
      row_begin[c * (height + 1) + y] = set.first_of_row(c, std::min((y + 1) / 2, set.height));
    }
  }
  set.height = height;
  set.row_begin = std::move(row_begin);
  for (Feature& feature : set.features) {
    feature.x *= 2;
    feature.y *= 2;
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

void FeatureDetector::suppress_rows(int y, int width, int height) {
  const auto row = [width](const std::vector<std::int16_t>& ring, int at) {
    return ring.data() + static_cast<std::size_t>(at % kRingRows) * width;
  };
  const auto around = [&](const std::vector<std::int16_t>& ring) {
    RingRows rows;
    for (int i = 0; i < kTwoRows; ++i) rows[i] = row(ring, y - kSuppressionRadius + i);
    return rows;
  };
  for (int f = 0; f < 2; ++f) {
    flag_extrema(row(response_[f], y), row(response_[f], y + 1), around(row_max_[f]), around(row_min_[f]),
                 least_[2 * f].data(), least_[2 * f + 1].data(), flags_[0].data(), flags_[1].data(), width);
    for (int i = 0; i < 2; ++i) {
      if (y + i >= kMargin && y + i < height - kMargin)
        keep_strongest(f, row(response_[f], y + i), y + i, width, flags_[i]);
    }
  }
}

// A full cell lets in only a stronger one, in place of the weakest; ties go to the upper and left.
void FeatureDetector::keep_strongest(int filter, const std::int16_t* response, int y, int width,
                                     std::vector<std::uint8_t>& flags) {
  std::fill(flags.begin() + width - kMargin, flags.end(), std::uint8_t{0});
  for (int x0 = kMargin; x0 < width - kMargin; x0 += 8) {
    std::uint64_t word;
    std::memcpy(&word, flags.data() + x0, sizeof(word));
    if constexpr (std::endian::native == std::endian::big) word = __builtin_bswap64(word);
    for (; word != 0; word &= word - 1) {
      const int bit = std::countr_zero(word), x = x0 + bit / 8, feature_class = 2 * filter + bit % 8;
      const auto strength = static_cast<std::int16_t>(std::abs(response[x]));
      std::int16_t* least = least_[feature_class].data() + x / kCell * kCell;
      if (strength < *least) continue;  // one of this row raised it
      auto& found = found_[feature_class];
      auto& cell = cells_[feature_class][x / kCell];
      const std::uint64_t key = static_cast<std::uint64_t>(strength) << 32 | ~static_cast<std::uint32_t>(found.size());
      found.push_back({static_cast<std::int16_t>(x), static_cast<std::int16_t>(y), strength});
      if (cell.size() < per_cell_) {
        cell.push_back(key);
        if (cell.size() < per_cell_) continue;
      } else {
        found[~static_cast<std::uint32_t>(cell.front())].strength = 0;
        cell.front() = key;
      }
      std::iter_swap(cell.begin(), std::min_element(cell.begin(), cell.end()));
      std::fill_n(least, kCell, static_cast<std::int16_t>((cell.front() >> 32) + 1));
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
  for (auto& flags : flags_) flags.resize(width + 8);
  const int columns = (width + kCell - 1) / kCell;
  for (auto& found : found_) found.clear();
  for (auto& cells : cells_) cells.resize(columns);
  per_cell_ = std::max(1, per_cell / kFeatureClasses);

  int filtered = 2;
  for (int y = kMargin - kMargin % 2; y < height - kMargin; y += 2) {
    for (; filtered <= y + 1 + kSuppressionRadius; ++filtered) filter_row(image, filtered);
    if (y % kCell == 0 || y < kMargin) {  // new cells
      for (auto& least : least_) least.assign(static_cast<std::size_t>(columns) * kCell, threshold);
      for (auto& cells : cells_) {
        for (auto& cell : cells) cell.clear();
      }
    }
    suppress_rows(y, width, height);
  }
  for (; filtered < height - 2; ++filtered) filter_row(image, filtered);  // descriptors reach farther

  for (int c = 0; c < kFeatureClasses; ++c) {
    int* row_begin = set.row_begin.data() + c * (height + 1);
    int row = 0;
    for (const Feature& feature : found_[c]) {
      if (feature.strength == 0) continue;
      for (; row <= feature.y; ++row) row_begin[row] = set.size();
      set.features.push_back(feature);
      set.classes.push_back(static_cast<std::uint8_t>(c));
      describe(smooth_, feature.x, feature.y, set.descriptors.emplace_back());
    }
    for (; row <= height; ++row) row_begin[row] = set.size();
  }
}

}  // namespace egosgm::odometry
