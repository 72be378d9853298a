// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

namespace egosgm::vision {

using Numbers = std::vector<std::string>;  // digits without leading zeros

/// The numbers in a name: 151 and 10 of 000151_10.
inline Numbers numbers_in(const std::string& name) {
  constexpr const char* kDigits = "0123456789";
  Numbers numbers;
  for (std::size_t at = name.find_first_of(kDigits); at != std::string::npos;) {
    const std::size_t end = std::min(name.find_first_not_of(kDigits, at), name.size());
    const std::size_t first = std::min(name.find_first_not_of('0', at), end - 1);
    numbers.push_back(name.substr(first, end - first));
    at = name.find_first_of(kDigits, end);
  }
  return numbers;
}

}  // namespace egosgm::vision
