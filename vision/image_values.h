// SPDX-License-Identifier: Apache-2.0
// All values of an image at once.
#pragma once

#include <cmath>
#include <cstdint>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Calls `act` with a row's first value, of the type that the image has, and how many values the row has.
template <typename Act>
void visit_row(const Image& image, int y, const Act& act) {
  const int count = image.cols * image.type.channels;
  if (image.type.channel == ChannelType::kU8) return act(image.row(y), count);
  if (image.type.channel == ChannelType::kU16) return act(image.row<std::uint16_t>(y), count);
  act(image.row<float>(y), count);
}

/// Calls `act` with each value, of the type that the image has.
template <typename Act>
void visit_values(Image& image, const Act& act) {
  for (int y = 0; y < image.rows; ++y) {
    visit_row(image, y, [&]<typename T>(const T* values, int count) {
      for (int i = 0; i < count; ++i) act(const_cast<T*>(values)[i]);
    });
  }
}

/// Sets the values of `map` to `value` where `other` has what `is_so` asks for. REQUIRES: kF32; one size, one channel.
template <typename IsSo>
void set_where(Image& map, float value, const Image& other, const IsSo& is_so) {
  for (int y = 0; y < map.rows; ++y) {
    float* values = map.row<float>(y);
    visit_row(other, y, [&](const auto* asked, int count) {
      for (int x = 0; x < count; ++x) values[x] = is_so(asked[x]) ? value : values[x];
    });
  }
}

/// The same values as floats.
EGOSGM_EXPORT Image as_floats(const Image& stored);

/// value * scale + shift, rounded to the nearest number, halves to even ones, and cut off at 0 and 255.
EGOSGM_EXPORT Image as_bytes(const Image& stored, double scale, double shift = 0);

}  // namespace egosgm::vision
