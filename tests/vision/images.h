// SPDX-License-Identifier: Apache-2.0
// Images of given values, and the values of images.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "egosgm/vision/image.h"
#include "vision/image_values.h"

namespace egosgm::vision {

/// These values row by row, of one channel of T.
template <typename T>
Image image_from(int rows, const std::vector<T>& values) {
  const ChannelType channel = std::is_same_v<T, float>           ? ChannelType::kF32
                              : std::is_same_v<T, std::uint16_t> ? ChannelType::kU16
                                                                 : ChannelType::kU8;
  Image image(rows, static_cast<int>(values.size()) / rows, {channel, 1});
  std::copy(values.begin(), values.end(), image.row<T>(0));
  return image;
}

inline Image map_from(int rows, const std::vector<float>& values) { return image_from(rows, values); }

/// A picture of one colour.
inline Image picture_of(Size size, Color color) {
  Image picture(size, kBgr8);
  picture.fill(color);
  return picture;
}

/// Calls `f(x, y)` row by row.
template <typename F>
void for_each_pixel(Size size, F&& f) {
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) f(x, y);
  }
}

/// All values, row by row.
inline std::vector<double> values_of(const Image& image) {
  std::vector<double> values;
  for (int y = 0; y < image.rows; ++y) {
    visit_row(image, y, [&](const auto* row, int count) { values.insert(values.end(), row, row + count); });
  }
  return values;
}

inline auto count_nonzero(const Image& image) {
  const std::vector<double> values = values_of(image);
  return static_cast<std::ptrdiff_t>(values.size()) - std::count(values.begin(), values.end(), 0);
}

/// The difference of values at one place; infinite where sizes or types differ.
inline double largest_difference(const Image& a, const Image& b) {
  if (a.size() != b.size() || a.type != b.type) return std::numeric_limits<double>::infinity();
  const std::vector<double> of_a = values_of(a), of_b = values_of(b);
  double largest = 0;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const double apart = of_a[i] == of_b[i] ? 0 : std::abs(of_a[i] - of_b[i]);
    largest = std::isnan(apart) ? std::numeric_limits<double>::infinity() : std::max(largest, apart);
  }
  return largest;
}

}  // namespace egosgm::vision
