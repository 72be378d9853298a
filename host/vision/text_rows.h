// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace egosgm::vision {

/// One row of a text file, without its end; `number` counts from 1.
struct TextRow {
  int number = 0;
  std::string_view text;
};

/// All rows, blank ones too; views into `text`.
std::vector<TextRow> split_rows(std::string_view text);

std::string_view trim(std::string_view text);

/// Tokens between blanks and tabs.
std::vector<std::string_view> split_tokens(std::string_view text);

/// The whole of `token` as a decimal number; empty if it is none. May be infinite or NaN. Independent of the locale.
std::optional<double> parse_number(std::string_view token);

/// For an error's line: shortened, unprintable characters replaced, in quotes.
std::string quoted(std::string_view text);

/// Throws InvalidArgument "FILE:ROW: why".
[[noreturn]] void refuse_row(const std::filesystem::path& file, int row, const std::string& why);

/// Appends `value` in scientific notation with `digits` decimals, independent of the locale.
void append_number(std::string& text, double value, int digits);

}  // namespace egosgm::vision
