// SPDX-License-Identifier: Apache-2.0
#include "vision/wide_matching.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <utility>
#include <vector>

#include "vision/no_value.h"

namespace egosgm::vision {
namespace {

constexpr int kCodeRadius = 2;                         // of the census: 24 neighbours, each darker, brighter or alike
constexpr int kNoise = 3;                              // grey levels; what differs by less is alike
constexpr int kSmall = 6, kLarge = 24, kLargest = 48;  // costs: of a step by 1, of a larger one, of a pixel
constexpr double kUnique = 1.05;                       // the second best cost by the best one's
constexpr int kMostDifference = 1;                     // between the views [px]
constexpr std::size_t kLeastPatch = 40;                // pixels; less is a speckle

using Codes = std::vector<std::uint64_t>;
using Costs = std::vector<std::uint16_t>;  // of each pixel, the disparities side by side

Codes census_of(const Image& image) {
  Codes codes(image.pixels());
  const auto row_at = [&](int y) { return image.row(std::clamp(y, 0, image.rows - 1)); };
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      std::uint64_t code = 0;
      for (int v = -kCodeRadius; v <= kCodeRadius; ++v) {
        for (int u = -kCodeRadius; u <= kCodeRadius; ++u) {
          if (u == 0 && v == 0) continue;
          const int other = row_at(y + v)[std::clamp(x + u, 0, image.cols - 1)], difference = other - row_at(y)[x];
          code = 4 * code + (difference < -kNoise ? 1 : difference > kNoise ? 2 : 0);
        }
      }
      codes[static_cast<std::size_t>(y * image.cols + x)] = code;
    }
  }
  return codes;
}

/// Semi-global matching (Hirschmueller 2008) of four paths, of disparities from -half to half - 1.
class Matching {
 public:
  Matching(const Image& left, const Image& right, int half)
      : width_(left.cols), height_(left.rows), half_(half), count_(static_cast<std::size_t>(2 * half)) {
    const Codes left_codes = census_of(left), right_codes = census_of(right);
    costs_.assign(left_codes.size() * count_, kLargest);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        for (int i = 0; i < 2 * half; ++i) {
          const int other = x - (i - half);
          if (other < 0 || other >= width_) continue;
          costs_[at(x, y) + static_cast<std::size_t>(i)] =
              static_cast<std::uint16_t>(std::popcount(left_codes[static_cast<std::size_t>(y * width_ + x)] ^
                                                       right_codes[static_cast<std::size_t>(y * width_ + other)]));
        }
      }
    }
    sums_.assign(costs_.size(), 0);
    for (int y = 0; y < height_; ++y) {
      add_path(at(0, y), static_cast<std::ptrdiff_t>(count_), width_);
      add_path(at(width_ - 1, y), -static_cast<std::ptrdiff_t>(count_), width_);
    }
    const auto row = static_cast<std::ptrdiff_t>(count_) * width_;
    for (int x = 0; x < width_; ++x) {
      add_path(at(x, 0), row, height_);
      add_path(at(x, height_ - 1), -row, height_);
    }
  }

  /// The map of pixels whose best disparity is unique, and the right view's too.
  Image map() const {
    Image map(height_, width_, kF32, kNoValue);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const std::uint16_t* sums = &sums_[at(x, y)];
        const int best = best_of(x, y);
        const int other = x - (best - half_);
        if (other < 0 || other >= width_ || !is_unique(sums, best)) continue;
        if (std::abs(best_of_right(other, y) - best) > kMostDifference) continue;
        map.at<float>(y, x) = static_cast<float>(best - half_) + part_of_a_pixel(sums, best);
      }
    }
    return map;
  }

 private:
  std::size_t at(int x, int y) const { return static_cast<std::size_t>(y * width_ + x) * count_; }

  void add_path(std::size_t pixel, std::ptrdiff_t step, int length) {
    std::vector<std::uint16_t> before(count_ + 2, 0), here(count_ + 2);
    std::uint16_t least = 0;
    for (int n = 0; n < length; ++n, pixel += static_cast<std::size_t>(step)) {
      std::uint16_t next_least = std::numeric_limits<std::uint16_t>::max();
      before.front() = before.back() = std::numeric_limits<std::uint16_t>::max() - kSmall;
      for (std::size_t i = 0; i < count_; ++i) {
        const int smooth = std::min({int{before[i + 1]}, before[i] + kSmall, before[i + 2] + kSmall, least + kLarge});
        here[i + 1] = static_cast<std::uint16_t>(costs_[pixel + i] + smooth - least);
        next_least = std::min(next_least, here[i + 1]);
        sums_[pixel + i] = static_cast<std::uint16_t>(sums_[pixel + i] + here[i + 1]);
      }
      std::swap(before, here);
      least = next_least;
    }
  }

  int best_of(int x, int y) const {
    const auto first = sums_.begin() + static_cast<std::ptrdiff_t>(at(x, y));
    return static_cast<int>(std::min_element(first, first + static_cast<std::ptrdiff_t>(count_)) - first);
  }

  int best_of_right(int x, int y) const {
    int best = 0, least = std::numeric_limits<int>::max();
    for (int i = std::max(0, half_ - x); i < std::min(2 * half_, width_ - x + half_); ++i) {
      const int sum = sums_[at(x + i - half_, y) + static_cast<std::size_t>(i)];
      if (sum < least) least = sum, best = i;
    }
    return best;
  }

  bool is_unique(const std::uint16_t* sums, int best) const {
    for (int i = 0; i < 2 * half_; ++i) {
      if (std::abs(i - best) > 1 && sums[i] < kUnique * sums[best] + 1) return false;
    }
    return true;
  }

  float part_of_a_pixel(const std::uint16_t* sums, int best) const {
    if (best == 0 || best == 2 * half_ - 1) return 0;
    const float before = sums[best - 1], after = sums[best + 1], bend = before + after - 2.0f * sums[best];
    return bend > 0 ? (before - after) / (2 * bend) : 0;
  }

  const int width_, height_, half_;
  const std::size_t count_;
  Costs costs_, sums_;
};

/// Patches of less than kLeastPatch pixels go.
void drop_speckles(Image& map) {
  Image seen(map.size(), kU8, 0);
  struct Pixel {
    int x, y;
  };
  std::vector<Pixel> patch;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      if (seen.at<std::uint8_t>(y, x) || !has_value(map.at<float>(y, x))) continue;
      patch.assign(1, {x, y});
      seen.at<std::uint8_t>(y, x) = 1;
      for (std::size_t i = 0; i < patch.size(); ++i) {
        const Pixel from = patch[i];
        for (const auto [dx, dy] : {Pixel{1, 0}, Pixel{-1, 0}, Pixel{0, 1}, Pixel{0, -1}}) {
          const Pixel to{from.x + dx, from.y + dy};
          if (to.x < 0 || to.y < 0 || to.x >= map.cols || to.y >= map.rows || seen.at<std::uint8_t>(to.y, to.x))
            continue;
          if (!(std::abs(map.at<float>(to.y, to.x) - map.at<float>(from.y, from.x)) <= 1)) continue;
          seen.at<std::uint8_t>(to.y, to.x) = 1;
          patch.push_back(to);
        }
      }
      if (patch.size() >= kLeastPatch) continue;
      for (const Pixel pixel : patch) map.at<float>(pixel.y, pixel.x) = kNoValue;
    }
  }
}

}  // namespace

Image match_widely(const Image& left, const Image& right, int half) {
  Image map = Matching(left, right, half).map();
  drop_speckles(map);
  return map;
}

Image shrunk_grey(const Image& image, int factor, double down_px) {
  Image small(image.rows / factor, image.cols / factor, kU8);
  const int whole = static_cast<int>(std::floor(down_px));
  const double part = down_px - whole;
  for (int y = 0; y < small.rows; ++y) {
    for (int x = 0; x < small.cols; ++x) {
      double sum = 0;
      for (int v = y * factor + whole; v < (y + 1) * factor + whole; ++v) {
        const std::uint8_t *row = image.row(std::clamp(v, 0, image.rows - 1)),
                           *next = image.row(std::clamp(v + 1, 0, image.rows - 1));
        for (int u = x * factor; u < (x + 1) * factor; ++u) sum += (1 - part) * row[u] + part * next[u];
      }
      small.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(std::lround(sum / (factor * factor)));
    }
  }
  return small;
}

}  // namespace egosgm::vision
