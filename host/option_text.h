// SPDX-License-Identifier: Apache-2.0
// Options as texts, and texts as options: numbers, truth values and names of choices.
#pragma once

#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <type_traits>

#include "egosgm/error.h"
#include "host/method_options.h"

namespace egosgm::option_text {

template <typename Enum>
struct Choice {
  const char* name;
  Enum value;
};
constexpr Choice<MatchingCost> choice(MatchingCost, int i) {
  constexpr Choice<MatchingCost> choices[] = {{"census9x7", MatchingCost::kCensus9x7},
                                              {"census5x5", MatchingCost::kCensus5x5},
                                              {"sad3x3", MatchingCost::kSad3x3}};
  return i < 3 ? choices[i] : Choice<MatchingCost>{nullptr, {}};
}
constexpr Choice<Preset> choice(Preset, int i) {
  constexpr Choice<Preset> choices[] = {{"default", Preset::kDefault}, {"paper", Preset::kPaper}};
  return i < 2 ? choices[i] : Choice<Preset>{nullptr, {}};
}
constexpr Choice<SearchMode> choice(SearchMode, int i) {
  constexpr Choice<SearchMode> choices[] = {{"band", SearchMode::kBand}, {"full", SearchMode::kFull}};
  return i < 2 ? choices[i] : Choice<SearchMode>{nullptr, {}};
}
constexpr Choice<Scheduling> choice(Scheduling, int i) {
  constexpr Choice<Scheduling> choices[] = {
      {"automatic", Scheduling::kAutomatic}, {"wavefront", Scheduling::kWavefront}, {"paths", Scheduling::kPaths}};
  return i < 3 ? choices[i] : Choice<Scheduling>{nullptr, {}};
}

inline std::string text_of(int value) { return std::to_string(value); }
inline std::string text_of(bool value) { return value ? "true" : "false"; }
inline std::string text_of(float value) {
  char buffer[32];
  const auto result =
      std::to_chars(buffer, buffer + sizeof buffer, value);  // the shortest that reads back to the same bits
  return {buffer, result.ptr};
}
template <typename Enum>
std::string text_of(Enum value) {
  for (int i = 0; choice(value, i).name; ++i) {
    if (choice(value, i).value == value) return choice(value, i).name;
  }
  return "?";
}

[[noreturn]] inline void refuse(std::string_view name, std::string_view value, const std::string& allowed) {
  throw InvalidArgument("option " + std::string(name) + ": \"" + std::string(value) + "\" is not " + allowed);
}

template <typename Number>
void parse_number(std::string_view name, std::string_view text, Number& value, const char* allowed) {
  Number parsed{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (error == std::errc::result_out_of_range) refuse(name, text, std::string(allowed) + " of 32 bits");
  if (error != std::errc() || end != text.data() + text.size()) refuse(name, text, allowed);
  value = parsed;
}
inline void parse(std::string_view name, std::string_view text, int& value) {
  parse_number(name, text, value, "a whole number");
}
inline void parse(std::string_view name, std::string_view text, float& value) {
  parse_number(name, text, value, "a number");
}
inline void parse(std::string_view name, std::string_view text, bool& value) {
  if (text == "true" || text == "on" || text == "yes" || text == "1") {
    value = true;
  } else if (text == "false" || text == "off" || text == "no" || text == "0") {
    value = false;
  } else {
    refuse(name, text, "on or off (nor true, false, yes, no, 1, 0)");
  }
}
template <typename Enum>
void parse(std::string_view name, std::string_view text, Enum& value) {
  std::string allowed;
  for (int i = 0; choice(value, i).name; ++i) {
    if (text == choice(value, i).name) {
      value = choice(value, i).value;
      return;
    }
    allowed += std::string(i ? ", " : "one of ") + choice(value, i).name;
  }
  refuse(name, text, allowed);
}

template <typename Number>
void expect(const char* name, Number value, bool allowed, const char* remedy) {
  if (!allowed) throw InvalidArgument(std::string("option ") + name + " is " + text_of(value) + ": " + remedy);
}

inline void expect_not_negative(const char* name, float value) {
  expect(name, value, std::isfinite(value) && value >= 0, "choose a finite number, zero or more");
}

}  // namespace egosgm::option_text
