// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

namespace egosgm {

/// The value that stands at `index` once they are sorted. REQUIRES: index < values.size().
template <typename T>
T nth_value(std::vector<T> values, std::size_t index) {
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// Of an even number of values, the greater one in the middle. REQUIRES: a value.
template <typename T>
T median(std::vector<T> values) {
  const std::size_t middle = values.size() / 2;
  return nth_value(std::move(values), middle);
}

}  // namespace egosgm
