// SPDX-License-Identifier: Apache-2.0
#include "apps/suggestion.h"

#include <algorithm>

#include "host/edit_distance.h"

namespace egosgm::app {
namespace {

/// The path that is there and that `typed`, which is not, was probably meant to be; else empty.
std::string path_suggestion(const std::filesystem::path& typed) {
  namespace fs = std::filesystem;
  std::error_code error;
  fs::path known;
  for (auto part = typed.begin(); part != typed.end(); ++part) {
    if (fs::exists(known / *part, error)) {
      known /= *part;
      continue;
    }
    if (part->string().find_first_of("*%") != std::string::npos) return {};
    std::vector<std::string> names;
    fs::directory_iterator entry(known.empty() ? "." : known, error);
    for (; !error && entry != fs::directory_iterator(); entry.increment(error))
      names.push_back(entry->path().filename().string());
    const std::string nearest = suggestion(part->string(), names);
    if (nearest.empty()) return {};
    known /= nearest;
    while (++part != typed.end()) known /= *part;
    return fs::exists(known, error) ? known.string() : std::string();
  }
  return {};
}

}  // namespace

std::string suggestion(const std::string& typed, const std::vector<std::string>& known) {
  std::string nearest;
  // Farther is not a typing error; nor is what shares no letter.
  const int letters = static_cast<int>(typed.size() - std::min(typed.find_first_not_of('-'), typed.size()));
  int least = std::min(1 + letters / 3, letters - 1);
  for (const std::string& name : known) {
    const bool begins = typed.size() >= 4 && name.starts_with(typed);
    const int distance = begins ? 1 : edit_distance(typed, name);
    if (distance <= least && (nearest.empty() || distance < least)) {
      least = distance;
      nearest = name;
    }
  }
  return nearest;
}

std::string meant_path(const MissingPath& error) {
  const std::string path = path_suggestion(error.path());
  return path.empty() ? "" : "; did you mean " + path + "?";
}

}  // namespace egosgm::app
