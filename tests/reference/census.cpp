// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/census.h"

#include <algorithm>
#include <cstdlib>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

struct Offset {
  int dx, dy;
};

std::vector<Offset> window(int radius_x, int radius_y) {
  std::vector<Offset> offsets;
  for (int dy = -radius_y; dy <= radius_y; ++dy) {
    for (int dx = -radius_x; dx <= radius_x; ++dx) {
      if (dx != 0 || dy != 0) offsets.push_back({dx, dy});
    }
  }
  return offsets;
}

}  // namespace

std::vector<std::uint64_t> codes(shared::ImageSize size, const std::vector<std::uint16_t>& image, int bits,
                                 MatchingCost cost) {
  const auto at = [&](int x, int y) {
    return image[static_cast<std::size_t>(std::clamp(y, 0, size.height - 1)) * size.width +
                 std::clamp(x, 0, size.width - 1)];
  };
  const std::vector<Offset> offsets = cost == MatchingCost::kCensus9x7 ? window(4, 3)
                                      : cost == MatchingCost::kSad3x3  ? std::vector<Offset>{}
                                                                       : window(2, 2);
  std::vector<std::uint64_t> codes;
  codes.reserve(image.size());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      std::uint64_t code = cost == MatchingCost::kSad3x3 ? at(x, y) >> (bits - 8) : 0;
      for (const Offset& offset : offsets) code = 2 * code + (at(x + offset.dx, y + offset.dy) < at(x, y));
      codes.push_back(code);
    }
  }
  return codes;
}

std::vector<std::uint64_t> alike_codes(shared::ImageSize size, const std::vector<std::uint16_t>& image) {
  std::vector<std::uint64_t> codes;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto difference = [&](const Offset& offset) {
        const auto at = [&](int u, int v) {
          return int{image[static_cast<std::size_t>(std::clamp(v, 0, size.height - 1)) * size.width +
                           std::clamp(u, 0, size.width - 1)]};
        };
        return std::abs(at(x + offset.dx, y + offset.dy) - at(x, y));
      };
      std::vector<int> around;
      for (const Offset& offset : window(1, 1)) around.push_back(difference(offset));
      std::nth_element(around.begin(), around.begin() + 3, around.end());
      const int tolerance = std::min(16 * around[3] + 128, 65535);
      std::uint64_t code = 0;
      for (const Offset& offset : window(4, 3)) code = 2 * code + (difference(offset) <= tolerance);
      codes.push_back(code);
    }
  }
  return codes;
}

int word_count(MatchingCost cost) { return cost == MatchingCost::kCensus9x7 ? 2 : 1; }

std::vector<std::uint32_t> padded_codes(shared::ImageSize size, const std::vector<std::uint64_t>& left,
                                        const std::vector<std::uint64_t>& right, int padding, MatchingCost cost) {
  std::vector<std::uint32_t> words;
  for (int view = 0; view < 2; ++view) {
    for (int y = 0; y < size.height; ++y) {
      for (int i = -padding; i < size.width + padding; ++i) {
        const int along = std::clamp(i, 0, size.width - 1);
        const int x = view == EGOSGM_LEFT ? along : size.width - 1 - along;
        const std::uint64_t code = (view == EGOSGM_LEFT ? left : right)[static_cast<std::size_t>(y) * size.width + x];
        words.push_back(static_cast<std::uint32_t>(code));
        if (word_count(cost) == 2) words.push_back(static_cast<std::uint32_t>(code >> 32));
      }
    }
  }
  return words;
}

}  // namespace egosgm::reference
