// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/defines.h"

#include <algorithm>
#include <cstdio>

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
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%af", static_cast<double>(value));
  return buffer;
}

}  // namespace egosgm::ocl
