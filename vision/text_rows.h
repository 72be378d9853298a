// SPDX-License-Identifier: Apache-2.0
// The one way in which rows of text files are read: calibrations, poses, times, lists and configurations, by the
// library and by the program. Inline, as the program links no internal function of the library.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "egosgm/error.h"

namespace egosgm::vision {

inline constexpr std::size_t kMaxRowBytes = std::size_t{1} << 16;
inline constexpr std::size_t kMaxRows = 2'000'000;
inline constexpr std::string_view kBlanks = " \t\r";

/// One row of a text file, without its end; `number` counts from 1.
struct TextRow {
  int number = 0;
  std::string_view text;
};

inline std::string_view trim(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  return text.substr(0, text.find_last_not_of(kBlanks) + 1);
}

/// For an error's line: shortened, unprintable characters replaced, in quotes.
inline std::string quoted(std::string_view text) {
  constexpr std::size_t kMaxCharacters = 40;
  std::string result = "'";
  for (char c : text.substr(0, kMaxCharacters)) result += c >= ' ' && c <= '~' ? c : '?';
  return result + (text.size() > kMaxCharacters ? "...'" : "'");
}

/// Throws InvalidArgument "FILE:ROW: why".
[[noreturn]] inline void refuse_row(const std::filesystem::path& file, int row, const std::string& why) {
  throw InvalidArgument(file.string() + ":" + std::to_string(row) + ": " + why);
}

/// `text` without the mark of UTF-8 that some editors begin a file with.
inline std::string_view without_mark(std::string_view text) {
  constexpr std::string_view kMark = "\xef\xbb\xbf";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  return text;
}

/// All rows of `file`, blank ones too; views into `text`, which may begin with the mark of UTF-8. Throws
/// InvalidArgument where it is UTF-16, a row has more than 65,536 bytes or there are more than 2,000,000.
inline std::vector<TextRow> split_rows(std::string_view text, const std::filesystem::path& file) {
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) {
    throw InvalidArgument(file.string() + ": is UTF-16, as some editors write: save it as UTF-8");
  }
  std::vector<TextRow> rows;
  text = without_mark(text);
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    if (rows.size() == kMaxRows) {
      refuse_row(file, number, "a text may have " + std::to_string(kMaxRows) + " rows at most: is it the right file?");
    }
    if (end > kMaxRowBytes) {
      refuse_row(file, number,
                 "a row may have " + std::to_string(kMaxRowBytes) + " bytes at most, this one has " +
                     std::to_string(end) + ": is it the right file?");
    }
    rows.push_back({number, text.substr(0, end)});
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return rows;
}

/// Tokens between blanks and tabs.
std::vector<std::string_view> split_tokens(std::string_view text);

/// The whole of `token` as a decimal number; empty if it is none. May be infinite or NaN. Independent of the locale.
inline std::optional<double> parse_number(std::string_view token) {
  if (token.size() > 1 && token.front() == '+' && token[1] != '-') token.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  if (error != std::errc() || end != token.data() + token.size()) return std::nullopt;
  return value;
}

/// Appends `value` in scientific notation with `digits` decimals, independent of the locale.
void append_number(std::string& text, double value, int digits);

}  // namespace egosgm::vision
