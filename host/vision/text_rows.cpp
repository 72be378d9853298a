// SPDX-License-Identifier: Apache-2.0
#include "host/vision/text_rows.h"

#include <charconv>

#include "egosgm/error.h"

namespace egosgm::vision {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

}  // namespace

std::vector<TextRow> split_rows(std::string_view text) {
  std::vector<TextRow> rows;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    rows.push_back({number, text.substr(0, end)});
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return rows;
}

std::string_view trim(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::vector<std::string_view> split_tokens(std::string_view text) {
  std::vector<std::string_view> tokens;
  for (text = trim(text); !text.empty(); text = trim(text)) {
    std::size_t end = 0;
    while (end < text.size() && !is_blank(text[end])) ++end;
    tokens.push_back(text.substr(0, end));
    text.remove_prefix(end);
  }
  return tokens;
}

std::optional<double> parse_number(std::string_view token) {
  if (token.size() > 1 && token.front() == '+' && token[1] != '-') token.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error != std::errc() || end != token.data() + token.size()) return std::nullopt;
  return value;
}

std::string quoted(std::string_view text) {
  constexpr std::size_t kMaxCharacters = 40;
  std::string result = "'";
  for (char c : text.substr(0, kMaxCharacters)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > kMaxCharacters ? "...'" : "'");
}

void refuse_row(const std::filesystem::path& file, int row, const std::string& why) {
  throw InvalidArgument(file.string() + ":" + std::to_string(row) + ": " + why);
}

void append_number(std::string& text, double value, int digits) {
  char buffer[64];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::scientific, digits);
  if (error == std::errc()) text.append(buffer, end);
}

}  // namespace egosgm::vision
