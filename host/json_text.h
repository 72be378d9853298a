// SPDX-License-Identifier: Apache-2.0
// The one way in which JSON of files is read: bounded, as what walks through it recurses and looks keys up one by one.
#pragma once

#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "egosgm/error.h"

namespace egosgm {

inline constexpr int kMaxJsonDepth = 64;
inline constexpr std::size_t kMaxJsonKeys = 2000;         // of one object
inline constexpr std::size_t kMaxJsonBytes = 256u << 20;  // what a file's reader gives at most

/// The text as JSON; discarded (`is_discarded`) where it is none. Throws InvalidArgument, naming `file`, where it is
/// nested deeper than 64 levels, an object has more than 2,000 keys, or the text is longer than 256 MiB.
inline nlohmann::ordered_json parse_json(std::string_view text, const std::filesystem::path& file) {
  using Json = nlohmann::ordered_json;
  const auto refuse = [&](const std::string& why) { throw InvalidArgument(file.string() + ": " + why); };
  if (text.size() > kMaxJsonBytes) refuse("is longer than 256 MiB: is it the right file?");
  std::vector<std::size_t> keys(kMaxJsonDepth + 2);
  const auto check = [&](int depth, Json::parse_event_t event, Json&) {
    if (event == Json::parse_event_t::key && ++keys[static_cast<std::size_t>(depth)] > kMaxJsonKeys) {
      refuse("has an object of more than " + std::to_string(kMaxJsonKeys) + " keys: is it the right file?");
    }
    if (event == Json::parse_event_t::object_start || event == Json::parse_event_t::array_start) {
      if (depth >= kMaxJsonDepth) {
        refuse("is nested deeper than " + std::to_string(kMaxJsonDepth) + " levels: is it the right file?");
      }
      keys[static_cast<std::size_t>(depth) + 1] = 0;
    }
    return true;
  };
  return Json::parse(text, check, /*allow_exceptions=*/false);
}

/// JSON as files have it: what is no UTF-8, as some names of files, is replaced.
inline std::string dumped(const nlohmann::ordered_json& json, int indent = -1) {
  return json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// Returns what a reader of this JSON's file gets.
inline nlohmann::ordered_json as_in_file(const nlohmann::ordered_json& json) {
  return nlohmann::ordered_json::parse(dumped(json));
}

}  // namespace egosgm
