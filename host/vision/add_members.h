// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

namespace egosgm::vision {

template <typename T, std::size_t kCount>
std::array<T, kCount>& operator+=(std::array<T, kCount>& sums, const std::array<T, kCount>& others) {
  for (std::size_t i = 0; i < kCount; ++i) sums[i] += others[i];
  return sums;
}

/// Adds the `members` of `other` to those of `sums`.
template <typename Counts, typename... Members>
Counts& add_members(Counts& sums, const Counts& other, Members Counts::*... members) {
  ((sums.*members += other.*members), ...);
  return sums;
}

}  // namespace egosgm::vision
