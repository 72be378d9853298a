// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/vertical_alignment.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace egosgm::reference {
namespace {

constexpr int kTerms = EGOSGM_OFFSET_TERMS;
constexpr float kPrior = 0.01f;

int floor_divided(int a, int b) { return a / b - (a % b < 0 ? 1 : 0); }

/// From -steps to steps over `count` rows or columns.
int place(int at, int count, int steps) {
  const float from_middle = static_cast<float>(2 * at + 1 - count);
  return static_cast<int>(std::nearbyint(from_middle * (static_cast<float>(steps) / static_cast<float>(count))));
}

/// Solves matrix * x = right by Gauss's elimination, of which it needs the lower half. False where a pivot is not above
/// `least`.
bool solve(std::array<std::array<float, kTerms>, kTerms> matrix, std::array<float, kTerms>& x, float least) {
  for (int j = 0; j < kTerms; ++j) {
    if (!(matrix[j][j] > least)) return false;
    for (int i = j + 1; i < kTerms; ++i) {
      const float factor = matrix[i][j] / matrix[j][j];
      for (int k = j + 1; k <= i; ++k) matrix[i][k] -= factor * matrix[k][j];
      x[i] -= factor * x[j];
    }
  }
  for (int i = kTerms - 1; i >= 0; --i) {
    for (int k = i + 1; k < kTerms; ++k) x[i] -= matrix[k][i] * x[k];
    x[i] /= matrix[i][i];
  }
  return true;
}

/// A sum of products without loss: their parts above and below 2^19 apart, which 64 bits hold.
struct Sum {
  std::int64_t high = 0, low = 0;

  void add(std::int64_t value, std::int64_t factor) {
    constexpr std::int64_t kUnit = 1 << 19;
    const std::int64_t below = (value % kUnit + kUnit) % kUnit;
    high += (value - below) / kUnit * factor;
    low += below * factor;
  }
  float rounded() const { return static_cast<float>(high) * (1 << 19) + static_cast<float>(low); }
};

}  // namespace

float offset_at(shared::ImageSize size, const VerticalOffset& offset, int x, int y) {
  const auto& c = offset.terms_px;
  const float u = static_cast<float>(place(x, size.width, 256)) / 256;
  const float v = static_cast<float>(place(y, size.height, 256)) / 256;
  const float along_v = (c[0] + c[2] * v) + c[5] * (v * v), along_u = c[1] + c[3] * v;
  return std::clamp(along_v + (along_u + c[4] * u) * u, -2.0f, 2.0f);
}

std::vector<int> resample(shared::ImageSize size, const VerticalOffset& offset, const std::vector<int>& images) {
  std::vector<int> aligned = images;
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const float offset_px = offset_at(size, offset, x / 16 * 16 + 8, y);
      const int steps = static_cast<int>(std::nearbyint(offset_px * 256.0f));
      const int rows = floor_divided(steps, 256), part = steps - 256 * rows;
      const auto value = [&](int row) {
        return images[pixels + static_cast<std::size_t>(std::clamp(row, 0, size.height - 1)) * size.width + x];
      };
      aligned[pixels + static_cast<std::size_t>(y) * size.width + x] =
          (value(y + rows) * (256 - part) + value(y + rows + 1) * part + 128) / 256;
    }
  }
  return aligned;
}

VerticalOffset estimate_offset(shared::ImageSize size, float gain, const std::vector<int>& aligned, int grey,
                               const std::vector<float>& left_disparity, const VerticalOffset& known) {
  constexpr int kPowerOfU[] = {0, 1, 0, 1, 2, 0}, kPowerOfV[] = {0, 0, 1, 1, 0, 2};
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  std::array<std::array<Sum, kTerms>, kTerms> matrix_sums;
  std::array<Sum, kTerms> step_sums;
  std::int64_t count = 0;
  for (int y = 4; y < size.height - 4; y += 4) {
    std::int64_t row_gr[3] = {}, row_gg[5] = {};  // times powers of u
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
      const std::int64_t right_place = place(u, size.width, 32);
      std::int64_t gr = g * std::clamp(r, -max_r, max_r), gg = std::abs(r) < max_r ? 4 * g_left * g_right : 0;
      for (std::int64_t& sum : row_gr) sum += gr, gr *= right_place;
      for (std::int64_t& sum : row_gg) sum += gg, gg *= right_place;
      count += std::abs(r) < max_r ? 1 : 0;
    }
    const std::int64_t v = place(y, size.height, 256), of_v[] = {1, v, v * v, v * v * v, v * v * v * v};
    for (int i = 0; i < kTerms; ++i) {
      step_sums[i].add(row_gr[kPowerOfU[i]], of_v[kPowerOfV[i]]);
      for (int j = 0; j <= i; ++j) {
        matrix_sums[i][j].add(row_gg[kPowerOfU[i] + kPowerOfU[j]], of_v[kPowerOfV[i] + kPowerOfV[j]]);
      }
    }
  }
  // Places as parts of half the image.
  const auto unit = [&](int i) { return std::ldexp(1.0f, -5 * kPowerOfU[i] - 8 * kPowerOfV[i]); };
  std::array<std::array<float, kTerms>, kTerms> matrix{};
  std::array<float, kTerms> step{};
  for (int i = 0; i < kTerms; ++i) {
    step[i] = step_sums[i].rounded() * unit(i);
    for (int j = 0; j <= i; ++j) matrix[i][j] = matrix_sums[i][j].rounded() * unit(i) * unit(j);
  }
  const float all = matrix[0][0];
  if (count < 256 || all <= 0) return known;
  const float mean_step = step[0] / all;
  for (int i = 1; i < kTerms; ++i) {
    matrix[i][i] += kPrior * all;
    step[i] -= kPrior * all * known.terms_px[i];
  }
  if (!solve(matrix, step, 0.5f * kPrior * all)) step = {mean_step};
  const float share = std::max(gain, 1.0f / std::max(known.estimates, 1.0f));
  VerticalOffset next{known.terms_px, std::min(known.estimates + 1, 1e6f)};
  for (int i = 0; i < kTerms; ++i) {
    next.terms_px[i] = std::clamp(known.terms_px[i] + share * std::clamp(step[i], -1.0f, 1.0f), -2.0f, 2.0f);
  }
  return next;
}

}  // namespace egosgm::reference
