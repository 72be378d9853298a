// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "kernels/shared.h"

namespace egosgm::testing {

/// Bit by bit, for stereo maps (two views of `size`) or anything else that lies row by row. Tells how many differ,
/// where the first is, and both values.
template <typename T>
::testing::AssertionResult same_bits(const std::vector<T>& actual, const std::vector<T>& expected,
                                     shared::ImageSize size) {
  if (actual.size() != expected.size()) {
    return ::testing::AssertionFailure() << actual.size() << " values, expected " << expected.size();
  }
  std::size_t different = 0, first = 0;
  for (std::size_t i = actual.size(); i-- > 0;) {
    if (std::memcmp(&actual[i], &expected[i], sizeof(T)) != 0) ++different, first = i;
  }
  if (different == 0) return ::testing::AssertionSuccess();
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  auto failure = ::testing::AssertionFailure();
  failure << different << " of " << actual.size() << " differ, the first in view " << first / pixels << " at ("
          << first % pixels % size.width << ", " << first % pixels / size.width << ")";
  if constexpr (std::is_arithmetic_v<T>) failure << ": " << +actual[first] << ", expected " << +expected[first];
  return failure;
}

/// The left view of `left` and the right one of `right`: what a stage leaves that works on the left view alone.
template <typename T>
std::vector<T> left_and_right(std::vector<T> left, const std::vector<T>& right) {
  if (right.size() != left.size()) return {};
  const auto half = static_cast<std::ptrdiff_t>(left.size() / 2);
  std::copy(right.begin() + half, right.end(), left.begin() + half);
  return left;
}

/// The sizes that every kernel is tested at: nothing is a multiple of anything. The largest stands in suites of its
/// own, `Large`, which lanes leave out that would take minutes for it.
inline const std::vector<shared::ImageSize> kSizes{{1, 1}, {7, 5}, {65, 3}, {127, 33}, {320, 97}};
inline constexpr shared::ImageSize kLargest{1242, 375};

inline std::string size_name(const ::testing::TestParamInfo<shared::ImageSize>& info) {
  return std::to_string(info.param.width) + "x" + std::to_string(info.param.height);
}

/// Makes the fixture of a kernel's TEST_Ps, which run at all of these sizes.
#define EGOSGM_TEST_AT_ALL_SIZES(Fixture)                                                             \
  class Fixture : public ::testing::TestWithParam<shared::ImageSize> {};                              \
  INSTANTIATE_TEST_SUITE_P(Sizes, Fixture, ::testing::ValuesIn(testing::kSizes), testing::size_name); \
  INSTANTIATE_TEST_SUITE_P(Large, Fixture, ::testing::Values(testing::kLargest), testing::size_name)

}  // namespace egosgm::testing
