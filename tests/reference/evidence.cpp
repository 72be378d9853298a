// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/evidence.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "tests/reference/method.h"

namespace egosgm::reference {
namespace {

constexpr int kSide = 4;  // of a block

bool is_valid(float disparity) { return disparity != EGOSGM_INVALID_DISPARITY; }

bool differ(float gate_px, float a, float b) { return gate_px > 0 && std::abs(a - b) > gate_px; }

/// What is asked of a pixel: the prediction, unless there is none or the measurement contradicts it.
float asked(float gate_px, float predicted, float measured) {
  if (!is_valid(predicted)) return measured;
  return is_valid(measured) && differ(gate_px, measured, predicted) ? measured : predicted;
}

/// The column of the other view that sees what column x sees at a disparity.
int seen_by_other(int view, int x, float disparity) {
  const int d = static_cast<int>(std::nearbyint(disparity));
  return view == EGOSGM_LEFT ? x - d : x + d;
}

/// The mean distance to codes `controls` columns from the match, less that of the match, in bits times their number.
/// Those of `bits` count.
template <std::size_t N>
std::optional<int> beyond(const ViewCodes& codes, const int (&controls)[N], int view, int x, int y, float disparity,
                          std::uint64_t bits = ~0ULL) {
  const int width = codes.size.width, match = seen_by_other(view, x, disparity);
  if (match < 0 || match >= width) return {};
  const std::size_t row = static_cast<std::size_t>(y) * width;
  const std::uint64_t own = codes.of_view[view][row + x];
  const auto distance = [&](int column) {
    return std::popcount(bits & (own ^ codes.of_view[1 - view][row + std::clamp(column, 0, width - 1)]));
  };
  int sum = 0;
  for (const int control : controls) sum += distance(match + control) - distance(match);
  return sum;
}

struct Sum {
  int evidence = 0, asked = 0, absent = 0;

  int count() const { return kEvidenceWeight * asked + absent; }
  int mean() const { return count() > 0 ? kEvidenceWeight * evidence / count() : 0; }
};

/// By a block's code of what is alike: 9x7 bits without the one in the middle, the first one the highest.
bool is_alike(std::uint64_t code, int dx, int dy) {
  if (dx == 0 && dy == 0) return true;
  const int place = 9 * (dy + 3) + dx + 4;
  return code >> (61 - (place > 31 ? place - 1 : place)) & 1;
}

}  // namespace

BlockEvidence block_evidence(float gate_px, const ViewCodes& codes, const std::optional<CoarseView>& coarse,
                             const testing::HostMaps& predicted, const testing::HostMaps& measured) {
  const int width = codes.size.width, height = codes.size.height;
  const int columns = (width + kSide - 1) / kSide, rows = (height + kSide - 1) / kSide;
  BlockEvidence result;
  for (int view = 0; view < 2; ++view) {
    const auto asked_at = [&](int x, int y) {
      const std::size_t i = (static_cast<std::size_t>(view) * height + y) * width + x;
      return asked(gate_px, predicted.disparity[i], measured.disparity[i]);
    };
    std::vector<Sum> sums(static_cast<std::size_t>(rows) * columns);
    const auto row_of = [&](int top) { return top + kSide / 2 < height ? top + kSide / 2 : top; };
    for (int top = 0; top < height; top += kSide) {  // codes of neighbouring rows are alike
      for (int x = 0; x < width; ++x) {
        const float d = asked_at(x, row_of(top));
        Sum& sum = sums[static_cast<std::size_t>(top / kSide) * columns + x / kSide];
        if (!is_valid(d)) ++sum.absent;
        const std::optional<int> four = is_valid(d) ? beyond(codes, kControls, view, x, row_of(top), d) : std::nullopt;
        if (four) sum.evidence += 16 * *four / 4, ++sum.asked;
      }
    }
    for (int i = 0; coarse && i < rows * columns; ++i) {
      const int x = i % columns, y = i / columns;
      const float d = asked_at(std::min(kSide * x + kSide / 2, width - 1), row_of(kSide * y));
      if (!is_valid(d)) continue;
      const std::optional<int> eight =
          beyond(coarse->codes, kCoarseControls, view, x, y, d / kSide, coarse->alike.of_view[view][i]);
      const int bits = std::popcount(coarse->alike.of_view[view][i]);
      if (eight && bits >= 12) sums[i].evidence += sums[i].asked * *eight * 62 / bits;  // 16 / 8, halved
    }
    for (int i = 0; i < rows * columns; ++i) {
      const int x = i % columns, y = i / columns;
      const auto over = [&](int left, int right, int up, int down) {
        Sum sum;
        for (int v = std::max(0, y - up); v <= std::min(rows - 1, y + down); ++v) {
          for (int u = std::max(0, x - left); u <= std::min(columns - 1, x + right); ++u) {
            if (coarse && !is_alike(coarse->alike.of_view[view][i], u - x, v - y)) continue;
            const Sum& block = sums[v * columns + u];
            sum.evidence += block.evidence, sum.asked += block.asked, sum.absent += block.absent;
          }
        }
        return sum;
      };
      int least = over(2, 2, 2, 2).mean();
      for (const Sum& half : {over(2, 0, 2, 2), over(0, 2, 2, 2), over(2, 2, 2, 0), over(2, 2, 0, 2)}) {
        if (2 * half.count() > 5 * 3 * kSide * kEvidenceWeight) least = std::min(least, half.mean());
      }
      result.evidence.push_back(least);
      const float d =
          coarse ? coarse->disparity[static_cast<std::size_t>(view) * rows * columns + i] : EGOSGM_INVALID_DISPARITY;
      result.found.push_back(is_valid(d) ? kSide * d : EGOSGM_INVALID_DISPARITY);
    }
  }
  return result;
}

Verdict judge(shared::ImageSize size, float gate_px, const FrameEvidence& frame, int view, int x, int y,
              float predicted, float measured) {
  if (!is_valid(predicted) && !is_valid(measured)) return {0, false, false};
  const bool stays = is_valid(predicted) && !(is_valid(measured) && differ(gate_px, measured, predicted));
  const auto moved = [&](int column, int row) {
    const bool is_inside = column >= 0 && column < size.width && row >= 0 && row < size.height;
    return is_inside ? int{frame.before[(static_cast<std::size_t>(view) * size.height + row) * size.width + column]}
                     : 0;
  };
  int before = moved(x, y);
  if (before == 0) before = std::min(moved(x - 1, y), moved(x + 1, y));
  const int step = frame.row_step;
  if (before == 0) before = std::min(moved(x, y - step), moved(x, y + step));
  if (frame.repeats && is_valid(predicted)) return {before, true, false};

  const int columns = (size.width + kSide - 1) / kSide, rows = (size.height + kSide - 1) / kSide;
  const std::size_t block = (static_cast<std::size_t>(view) * rows + y / kSide) * columns + x / kSide;
  const int now = frame.blocks.evidence[block];
  const float found = frame.blocks.found[block];
  const int match = stays ? seen_by_other(view, x, predicted) : x;
  if (match < 0 || match >= size.width) return {before * 58 / 64, true, now >= kEvidenceOfNoise};
  const bool is_found = is_valid(found) && std::abs(found - measured) <= kCoarseConfirmsPx;
  if (frame.sees_again && !is_valid(predicted) && !is_found) return {0, false, true};
  const int start = stays ? before * 45 / 64 : is_found ? 0 : -kEvidenceOfChoice;
  const bool is_contradicted = stays && is_valid(found) && std::abs(found - predicted) > kCoarseConfirmsPx;
  const int of_noise = is_contradicted ? 2 * kEvidenceOfNoise : kEvidenceOfNoise;
  const int evidence = std::min(start + now - of_noise, kMostEvidence);
  if (evidence < 0 && !stays && is_valid(predicted)) {  // what has no evidence contradicts nothing
    const int left = before * 45 / 64 - kEvidenceOfNoise;
    return {left, left >= 0, false};
  }
  return {evidence, evidence >= 0, !stays || now >= kEvidenceOfNoise};
}

Supporters supporters_of(shared::ImageSize size, const testing::HostMaps& maps, std::size_t view, int x, int y, float d,
                         float most) {
  Supporters result{0, x < 8, x + 8 >= size.width, y < 8, y + 8 >= size.height};
  for (const int dy : {-24, -16, -8, 0, 8, 16, 24}) {
    for (const int dx : {-24, -16, -8, 0, 8, 16, 24}) {
      const int u = x + dx, v = y + dy;
      if ((dx == 0 && dy == 0) || u < 0 || v < 0 || u >= size.width || v >= size.height) continue;
      const std::size_t i = view + static_cast<std::size_t>(v) * size.width + u;
      const float other = maps.disparity[i];
      const bool is_confirmed = maps.evidence.empty() || maps.evidence[i] >= kConfirmedEvidence;
      if (!is_valid(other) || std::abs(other - d) > most || !is_confirmed) continue;
      ++result.count;
      result.left = result.left || dx < 0;
      result.right = result.right || dx > 0;
      result.above = result.above || dy < 0;
      result.below = result.below || dy > 0;
    }
  }
  return result;
}

std::vector<float> confirmed(shared::ImageSize size, const testing::HostMaps& belief, bool by_left) {
  std::vector<float> result = belief.disparity;
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  for (std::size_t i = 0; i < result.size(); ++i) {
    const float d = belief.disparity[i];
    const int x = static_cast<int>(i % size.width), y = static_cast<int>(i % pixels / size.width);
    int of_pixel = belief.evidence[i];
    bool is_given = false;
    if (by_left && i >= pixels) {
      const float seen = std::nearbyint(static_cast<float>(x) + d);
      const bool is_inside = is_valid(d) && seen >= 0 && seen < static_cast<float>(size.width);
      of_pixel = is_inside ? belief.evidence[i - pixels - x + static_cast<std::size_t>(seen)] : 0;
      is_given = of_pixel >= kConfirmedEvidence;
    } else {
      is_given =
          of_pixel >= kTrustedEvidence || supporters_of(size, belief, i / pixels * pixels, x, y, d, 4).surround();
    }
    if (!is_valid(d) || !is_given) result[i] = EGOSGM_INVALID_DISPARITY;
  }
  return result;
}

}  // namespace egosgm::reference
