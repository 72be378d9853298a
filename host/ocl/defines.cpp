// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/defines.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace egosgm::ocl {

std::string Defines::text() const {
  std::string text;
  for (const auto& [name, value] : values_) text += " -D" + name + "=" + value;
  return text;
}

bool Defines::agrees_with(const Defines& other) const {
  return std::all_of(values_.begin(), values_.end(), [&](const auto& define) {
    const auto found = other.values_.find(define.first);
    return found == other.values_.end() || found->second == define.second;
  });
}

std::string Defines::literal(float value) {
  std::array<char, 32> digits;  // of no locale
  const auto [end, error] =
      std::to_chars(digits.data(), digits.data() + digits.size(), std::abs(value), std::chars_format::hex);
  return (std::signbit(value) ? "-0x" : "0x") + std::string(digits.data(), end) + "f";
}

}  // namespace egosgm::ocl
