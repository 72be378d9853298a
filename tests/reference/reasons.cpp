// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/reasons.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "egosgm/reason.h"
#include "tests/reference/census.h"
#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

class Pixels {
 public:
  Pixels(shared::ImageSize size, const MethodOptions& options, const ReasonInputs& inputs)
      : size_(size), options_(options), in_(inputs) {}

  Reason reason_of(int x, int y) const {
    const int known_y = y / in_.row_step * in_.row_step;
    const std::size_t i = index(x, known_y);
    const float d = in_.belief.disparity[index(x, y)], z = in_.measured[i],
                w = in_.warped.empty() ? kNone : in_.warped[i];
    if (!in_.hidden.empty() && in_.hidden[i]) return Reason::kNearer;
    if (z != kNone && w != kNone) {
      const bool differs = d == kNone ? std::abs(z - w) > 1 : in_.doubtful[i] != 0;
      if (differs) return Reason::kContradicted;
    }
    const Window window = around(x, y);
    if (2 * window.extreme >= window.pixels) return Reason::kSaturated;
    const bool is_judged = d != kNone && !in_.evidence.empty();
    const bool is_sure = is_judged && in_.evidence[i] > kTrustedEvidence;
    if (!is_sure &&
        static_cast<float>(window.changes) < kLeastChange * in_.grey_step * static_cast<float>(window.pixels)) {
      return Reason::kFlat;
    }
    const bool is_uncovered = !in_.warped.empty() && w == kNone && jump_beside(x, known_y) > kUncoveredJumpPx;
    if (d == kNone && !is_uncovered && is_like_noise(x, y)) return Reason::kFlat;
    const bool removes_speckles = options_.speckle_removal.max_size_px > 0;
    if (removes_speckles && d == kNone && z == kNone && in_.consistent[i] != kNone) return Reason::kSpeckle;
    if (d != kNone && z == kNone) return Reason::kPredicted;
    if (is_judged && in_.evidence[i] < kTrustedEvidence) return Reason::kFlat;
    if (is_uncovered) return Reason::kUncovered;
    if (options_.banded_sgm.cost != MatchingCost::kSad3x3 && repeats(x, y)) return Reason::kAmbiguous;
    return d == kNone ? Reason::kUnconfirmed : Reason::kTrusted;
  }

 private:
  struct Window {
    int pixels = 0, changes = 0, extreme = 0;
  };

  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * size_.width + x; }
  int grey(int x, int y) const { return in_.images[index(std::clamp(x, 0, size_.width - 1), y)]; }

  Window around(int x, int y) const {
    Window window;
    for (int v = std::max(y - kTextureRadius, 0); v <= std::min(y + kTextureRadius, size_.height - 1); ++v) {
      for (int u = x - kTextureRadius; u <= x + kTextureRadius; ++u) {
        ++window.pixels;
        window.changes += std::abs(grey(u + 1, v) - grey(u - 1, v));
        window.extreme += grey(u, v) == 0 || grey(u, v) == in_.white;
      }
    }
    return window;
  }

  float jump_beside(int x, int y) const {
    std::vector<float> near;
    for (int u = std::max(x - kUncoveredRadius, 0); u <= std::min(x + kUncoveredRadius, size_.width - 1); ++u) {
      if (in_.warped[index(u, y)] != kNone) near.push_back(in_.warped[index(u, y)]);
    }
    if (near.empty()) return 0;
    const auto [least, most] = std::minmax_element(near.begin(), near.end());
    return *most - *least;
  }

  bool is_like_noise(int x, int y) const {
    if (in_.evidence.empty()) return false;
    const int evidence = in_.block_evidence[(y / 4) * ((size_.width + 3) / 4) + x / 4];
    return evidence != 0 && evidence < kEvidenceOfNoise + kEvidenceOfChoice;
  }

  /// How many bits the codes of a grid around a pixel of the left view differ from those around another column, of the
  /// right view where `view` says so, in all; how many places the grid has. Columns may lie in the padding.
  struct Bits {
    int sum = 0, places = 0;
  };
  Bits bits_apart(int x, int other, int y, int view) const {
    const int words = word_count(options_.banded_sgm.cost);
    const int stride = size_.width + 2 * in_.code_padding;
    const auto code = [&](int of_view, int column, int row, int word) {
      const int place = of_view == EGOSGM_LEFT ? column : size_.width - 1 - column;
      const long at = static_cast<long>(of_view * size_.height + row) * stride + in_.code_padding + place;
      return in_.codes[static_cast<std::size_t>(at * words + word)];
    };
    Bits bits;
    for (int v = y - kRepeatRadius; v <= y + kRepeatRadius; v += kRepeatStep) {
      if (v < 0 || v >= size_.height) continue;
      for (int u = -kRepeatRadius; u <= kRepeatRadius; u += kRepeatStep) {
        ++bits.places;
        for (int word = 0; word < words; ++word) {
          bits.sum += std::popcount(code(EGOSGM_LEFT, x + u, v, word) ^ code(view, other + u, v, word));
        }
      }
    }
    return bits;
  }

  int most_bits(int x, int y) const {
    float z = in_.measured[index(x, y)];
    for (int u = x / 4 * 4; z == kNone && u < std::min(x / 4 * 4 + 4, size_.width); ++u) z = in_.measured[index(u, y)];
    const int match = x - static_cast<int>(z + 0.5f);
    const bool is_seen = z != kNone && match >= 0 && match < size_.width;
    const Bits around = bits_apart(x, is_seen ? match : x, y, is_seen ? EGOSGM_RIGHT : EGOSGM_LEFT);
    return std::max(around.sum, kRepeatBits * around.places);
  }

  /// Of the block of 4x4 pixels around, by the pixel in its middle.
  bool repeats(int of_x, int of_y) const {
    const int x = std::min(of_x / 4 * 4 + 2, size_.width - 1), y = std::min(of_y / 4 * 4 + 2, size_.height - 1);
    const int most = most_bits(x, y);
    for (int k = kLeastRepeatPx; k < options_.disparities; ++k) {
      if (x - k >= 0 && bits_apart(x, x - k, y, EGOSGM_LEFT).sum <= most) return true;
      if (x + k < size_.width && bits_apart(x, x + k, y, EGOSGM_LEFT).sum <= most) return true;
    }
    return false;
  }

  const shared::ImageSize size_;
  const MethodOptions& options_;
  const ReasonInputs& in_;
};

}  // namespace

std::vector<std::uint8_t> reasons(shared::ImageSize size, const MethodOptions& options, const ReasonInputs& inputs) {
  const Pixels pixels(size, options, inputs);
  std::vector<std::uint8_t> found;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) found.push_back(static_cast<std::uint8_t>(pixels.reason_of(x, y)));
  }
  return found;
}

}  // namespace egosgm::reference
