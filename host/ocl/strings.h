// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cctype>
#include <string>

namespace egosgm::ocl {

/// Trims a driver's text: without the terminating zero that CLHPP leaves in some drivers' strings, and without
/// blanks at its end.
inline std::string trimmed(std::string text) {
  text = text.substr(0, text.find('\0'));
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  return text;
}

}  // namespace egosgm::ocl
