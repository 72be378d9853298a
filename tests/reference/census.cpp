// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/census.h"

#include <algorithm>

namespace egosgm::reference {

std::vector<std::uint64_t> census(shared::ImageSize size, const std::vector<std::uint16_t>& image, int radius_x, int radius_y) {
  const auto at = [&](int x, int y) {
    return image[static_cast<std::size_t>(std::clamp(y, 0, size.height - 1)) * size.width + std::clamp(x, 0, size.width - 1)];
  };
  std::vector<std::uint64_t> codes;
  codes.reserve(image.size());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      std::uint64_t code = 0;
      for (int dy = -radius_y; dy <= radius_y; ++dy) {
        for (int dx = -radius_x; dx <= radius_x; ++dx) {
          if (dx != 0 || dy != 0) code = 2 * code + (at(x + dx, y + dy) < at(x, y));
        }
      }
      codes.push_back(code);
    }
  }
  return codes;
}

std::vector<std::uint64_t> padded_codes(shared::ImageSize size, const std::vector<std::uint64_t>& left,
                                        const std::vector<std::uint64_t>& right, int padding) {
  std::vector<std::uint64_t> codes;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < size.height; ++y) {
      for (int i = -padding; i < size.width + padding; ++i) {
        const int along = std::clamp(i, 0, size.width - 1);
        const int x = view == EGOSGM_LEFT ? along : size.width - 1 - along;
        codes.push_back((view == EGOSGM_LEFT ? left : right)[static_cast<std::size_t>(y) * size.width + x]);
      }
    }
  }
  return codes;
}

}  // namespace egosgm::reference
