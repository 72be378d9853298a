// SPDX-License-Identifier: Apache-2.0
#include "vision/text_rows.h"

#include <algorithm>
#include <charconv>

namespace egosgm::vision {
std::vector<std::string_view> split_tokens(std::string_view text) {
  std::vector<std::string_view> tokens;
  for (text = trim(text); !text.empty(); text = trim(text)) {
    const std::size_t end = std::min(text.find_first_of(kBlanks), text.size());
    tokens.push_back(text.substr(0, end));
    text.remove_prefix(end);
  }
  return tokens;
}

void append_number(std::string& text, double value, int digits) {
  char buffer[64];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::scientific, digits);
  if (error == std::errc()) text.append(buffer, end);
}

}  // namespace egosgm::vision
