// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/vertical_alignment.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace egosgm::reference {
namespace {

int floor_divided(int a, int b) { return a / b - (a % b < 0 ? 1 : 0); }

}  // namespace

std::vector<int> resample(shared::ImageSize size, float offset_px, const std::vector<int>& images) {
  std::vector<int> aligned = images;
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  const int offset = static_cast<int>(std::nearbyint(offset_px * 256.0f));
  const int rows = floor_divided(offset, 256), part = offset - 256 * rows;
  for (int y = 0; y < size.height; ++y) {
    const int above = std::clamp(y + rows, 0, size.height - 1), below = std::clamp(y + rows + 1, 0, size.height - 1);
    for (int x = 0; x < size.width; ++x) {
      const auto value = [&](int row) { return images[pixels + static_cast<std::size_t>(row) * size.width + x]; };
      aligned[pixels + static_cast<std::size_t>(y) * size.width + x] =
          (value(above) * (256 - part) + value(below) * part + 128) / 256;
    }
  }
  return aligned;
}

VerticalOffset estimate_offset(shared::ImageSize size, float gain, const std::vector<int>& aligned, int grey,
                               const std::vector<float>& left_disparity, VerticalOffset known) {
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  std::int64_t gr = 0, gg = 0, count = 0;
  for (int y = 4; y < size.height - 4; y += 4) {
    for (int x = 0; x < size.width; x += 2) {
      const float d = left_disparity[static_cast<std::size_t>(y) * size.width + x];
      if (d == EGOSGM_INVALID_DISPARITY) continue;
      const float right_x = static_cast<float>(x) - d;
      if (!(right_x >= 0 && right_x <= static_cast<float>(size.width - 2))) continue;
      const int sixteenths = static_cast<int>(std::nearbyint(right_x * 16)), u = sixteenths / 16,
                part = sixteenths % 16;
      // 16 times the grey value.
      const auto left = [&](int row) { return 16 * aligned[static_cast<std::size_t>(row) * size.width + x]; };
      const auto right = [&](int row) {
        const std::size_t i = pixels + static_cast<std::size_t>(row) * size.width + u;
        return (16 - part) * aligned[i] + part * aligned[i + 1];
      };
      const auto smoothed = [&](const auto& image) { return image(y - 1) + 2 * image(y) + image(y + 1); };
      const auto to_8_bit = [&](int value) { return floor_divided(value + grey / 2, grey); };
      const std::int64_t r = to_8_bit(smoothed(left) - smoothed(right));
      const std::int64_t g_left = to_8_bit(left(y + 1) - left(y - 1)), g_right = to_8_bit(right(y + 1) - right(y - 1));
      const std::int64_t g = g_left + g_right, max_r = 12 * 64;
      if (std::abs(g) < 2 * 64) continue;
      gr += g * std::clamp(r, -max_r, max_r);
      if (std::abs(r) >= max_r) continue;
      gg += 4 * g_left * g_right;
      ++count;
    }
  }
  if (count < 256 || gg <= 0) return known;
  const float step = std::clamp(static_cast<float>(gr) / static_cast<float>(gg), -1.0f, 1.0f);
  const float share = std::max(gain, 1.0f / std::max(known.estimates, 1.0f));
  return {std::clamp(known.offset_px + share * step, -2.0f, 2.0f), std::min(known.estimates + 1, 1e6f)};
}

}  // namespace egosgm::reference
