// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "kernels/shared.h"
#include "tests/support/compare.h"

namespace egosgm::testing {

/// Disparity and variance of both views, as the references take them. Of a prediction, `hidden` is 1 where a surface
/// nearer than the range hides what is behind; of an update, `doubtful` as on the device. Empty: all 0. `evidence`: of
/// a belief, or what moved with it.
struct HostMaps {
  std::vector<float> disparity, variance;
  std::vector<std::uint8_t> hidden = {}, doubtful = {}, evidence = {};
};

/// Both views without any value.
inline HostMaps empty_maps(shared::ImageSize size) {
  const std::size_t pixels = 2 * static_cast<std::size_t>(size.width) * size.height;
  return {std::vector<float>(pixels, EGOSGM_INVALID_DISPARITY), std::vector<float>(pixels, 0.0f)};
}

/// With variances of 0 where there is no disparity, as they mean nothing there.
inline HostMaps masked(HostMaps maps) {
  for (std::size_t i = 0; i < maps.variance.size(); ++i) {
    if (!(maps.disparity[i] > EGOSGM_INVALID_DISPARITY)) maps.variance[i] = 0;
  }
  return maps;
}

/// Piecewise smooth disparities in [min, max] with jumps, noise and about `holes` of the pixels invalid.
inline HostMaps random_maps(shared::ImageSize size, float min, float max, double holes, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> level(min, max), unit(0.0f, 1.0f);
  const std::size_t pixels = 2 * static_cast<std::size_t>(size.width) * size.height;
  HostMaps maps{std::vector<float>(pixels), std::vector<float>(pixels)};
  float base = level(random), slope = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    if (unit(random) < 0.03f) base = level(random), slope = 0.2f * (unit(random) - 0.5f);
    base += slope;
    const float d = std::min(max, std::max(min, base + unit(random) - 0.5f));
    const bool hole = unit(random) < holes;
    maps.disparity[i] = hole ? EGOSGM_INVALID_DISPARITY : d;
    maps.variance[i] = hole ? 0.0f : 0.05f + 3.0f * unit(random);
  }
  return maps;
}

/// What lies in a stage's output before; it must not shine through.
inline HostMaps earlier_maps(shared::ImageSize size) { return random_maps(size, 0, 9, 0.5, 99); }

/// Bit by bit, of all that `expected` has.
inline ::testing::AssertionResult same_maps(const HostMaps& actual, const HostMaps& expected, shared::ImageSize size) {
  const auto compare = [&](const auto& of_actual, const auto& of_expected, const char* name) {
    const auto same = of_expected.empty() ? ::testing::AssertionSuccess() : same_bits(of_actual, of_expected, size);
    return same ? same : ::testing::AssertionFailure() << name << ": " << same.message();
  };
  for (const auto& same :
       {compare(actual.disparity, expected.disparity, "disparity"),
        compare(actual.variance, expected.variance, "variance"), compare(actual.hidden, expected.hidden, "hidden"),
        compare(actual.doubtful, expected.doubtful, "doubtful"),
        compare(actual.evidence, expected.evidence, "evidence")}) {
    if (!same) return same;
  }
  return ::testing::AssertionSuccess();
}

/// The left view of `left` and the right one of `right`, of all that both have.
inline HostMaps left_and_right(const HostMaps& left, const HostMaps& right) {
  return {left_and_right(left.disparity, right.disparity), left_and_right(left.variance, right.variance),
          left_and_right(left.hidden, right.hidden), left_and_right(left.doubtful, right.doubtful),
          left_and_right(left.evidence, right.evidence)};
}

}  // namespace egosgm::testing
