// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/defines.h"

#include <cstdio>

namespace egosgm::ocl {

std::string Defines::text() const {
  std::string text;
  for (const auto& [name, value] : values_) text += " -D" + name + "=" + value;
  return text;
}

std::string Defines::literal(float value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%af", static_cast<double>(value));
  return buffer;
}

}  // namespace egosgm::ocl
