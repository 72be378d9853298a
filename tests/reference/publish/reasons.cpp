// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/publish/reasons.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "egosgm/reason.h"
#include "tests/reference/match/census.h"
#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

constexpr float kNone = EGOSGM_INVALID_DISPARITY;

class Pixels {
 public:
  Pixels(shared::ImageSize size, const MethodOptions& options, const ReasonInputs& inputs)
      : size_(size), options_(options), in_(inputs) {}

  Reason reason_of(int x, int y) const {
    const std::size_t i = index(x, y);
    const float d = in_.belief.disparity[i], z = in_.measured[i], w = in_.warped.empty() ? kNone : in_.warped[i];
    if (!in_.hidden.empty() && in_.hidden[i]) return Reason::kNearer;
    if (z != kNone && w != kNone) {
      const bool differs = d == kNone ? std::abs(z - w) > 1 : in_.doubtful[i] != 0;
      if (differs) return Reason::kContradicted;
    }
    const Window window = around(x, y);
    if (2 * window.extreme >= window.pixels) return Reason::kSaturated;
    if (static_cast<float>(window.changes) < kLeastChange * static_cast<float>(in_.white / 255 * window.pixels)) {
      return Reason::kFlat;
    }
    const bool removes_speckles = options_.speckle_removal.max_size_px > 0;
    if (removes_speckles && d == kNone && z == kNone && in_.consistent[i] != kNone) return Reason::kSpeckle;
    if (d != kNone && z == kNone) return Reason::kPredicted;
    if (d != kNone && !in_.evidence.empty() && in_.evidence[i] < kTrustedEvidence) return Reason::kFlat;
    if (!in_.warped.empty() && w == kNone && jump_beside(x, y) > kUncoveredJumpPx) return Reason::kUncovered;
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

  /// Of the codes at two places of a row, `step` columns and rows off; columns may lie in the padding.
  int distance(int a, int b, int y) const {
    const int words = word_count(options_.banded_sgm.cost);
    const std::size_t row = static_cast<std::size_t>(y) * (size_.width + 2 * in_.code_padding) + in_.code_padding;
    int bits = 0;
    for (int word = 0; word < words; ++word) {
      bits += std::popcount(in_.codes[(row + a) * words + word] ^ in_.codes[(row + b) * words + word]);
    }
    return bits;
  }

  bool is_alike(int x, int other, int y) const {
    if (distance(x, other, y) > kRepeatBits) return false;
    int bits = 0, places = 0;
    for (const int v : {y - kRepeatStep, y, y + kRepeatStep}) {
      for (const int u : {-kRepeatStep, 0, kRepeatStep}) {
        if (v < 0 || v >= size_.height) continue;
        ++places;
        bits += distance(x + u, other + u, v);
      }
    }
    return bits <= kRepeatBits * places;
  }

  bool repeats(int x, int y) const {
    for (int k = kLeastRepeatPx; k < options_.disparities; ++k) {
      if (x - k >= 0 && is_alike(x, x - k, y)) return true;
      if (x + k < size_.width && is_alike(x, x + k, y)) return true;
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
