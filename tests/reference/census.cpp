// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/census.h"

#include <algorithm>

namespace egosgm::reference {
namespace {

struct Comparison {
  int dx, dy, than_dx, than_dy;
};

std::vector<Comparison> window(int radius_x, int radius_y) {
  std::vector<Comparison> comparisons;
  for (int dy = -radius_y; dy <= radius_y; ++dy) {
    for (int dx = -radius_x; dx <= radius_x; ++dx) {
      if (dx != 0 || dy != 0) comparisons.push_back({dx, dy, 0, 0});
    }
  }
  return comparisons;
}

std::vector<Comparison> pairs() {
  constexpr int kPairs[32][4] = EGOSGM_PAIRS;
  std::vector<Comparison> comparisons;
  for (const auto& p : kPairs) comparisons.push_back({p[0], p[1], p[2], p[3]});
  return comparisons;
}

}  // namespace

std::vector<std::uint64_t> codes(shared::ImageSize size, const std::vector<std::uint16_t>& image, int bits,
                                 MatchingCost cost) {
  const auto at = [&](int x, int y) {
    return image[static_cast<std::size_t>(std::clamp(y, 0, size.height - 1)) * size.width +
                 std::clamp(x, 0, size.width - 1)];
  };
  const std::vector<Comparison> comparisons = cost == MatchingCost::kCensus9x7   ? window(4, 3)
                                              : cost == MatchingCost::kCensus5x5 ? window(2, 2)
                                              : cost == MatchingCost::kPairs32   ? pairs()
                                                                                 : std::vector<Comparison>{};
  std::vector<std::uint64_t> codes;
  codes.reserve(image.size());
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      std::uint64_t code = cost == MatchingCost::kSad3x3 ? at(x, y) >> (bits - 8) : 0;
      for (const Comparison& c : comparisons)
        code = 2 * code + (at(x + c.dx, y + c.dy) < at(x + c.than_dx, y + c.than_dy));
      codes.push_back(code);
    }
  }
  return codes;
}

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
        if (cost == MatchingCost::kCensus9x7) words.push_back(static_cast<std::uint32_t>(code >> 32));
      }
    }
  }
  return words;
}

}  // namespace egosgm::reference
