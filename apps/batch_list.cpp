// SPDX-License-Identifier: Apache-2.0
#include "apps/batch_list.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <sstream>

#include "egosgm/error.h"
#include "egosgm/vision/file_io.h"

namespace egosgm::app {
namespace {

constexpr std::size_t kMaxListBytes = std::size_t{1} << 30;  // a million sequences take a tenth
constexpr const char* kBlanks = " \t\r";

std::string stripped(std::string line) {
  line = line.substr(0, line.find('#'));
  line.erase(0, std::min(line.find_first_not_of(kBlanks), line.size()));
  line.erase(line.find_last_not_of(kBlanks) + 1);
  return line;
}

bool is_folder_name(const std::string& name) {
  return name.front() != '.' && std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return std::isalnum(c) || c == '.' || c == '_' || c == '-' || c == '+';
         });
}

BatchEntry parse(const std::string& line) {
  BatchEntry entry;
  const auto end = std::min(line.find_first_of(kBlanks), line.size());
  entry.name = line.substr(0, end);
  if (!is_folder_name(entry.name)) {
    throw InvalidArgument(fmt::format(
        "name \"{}\": choose letters, digits and . _ + - alone, not beginning with a dot; then the input", entry.name));
  }
  entry.arguments = stripped(line.substr(end));
  CLI::App arguments;
  entry.input.add_to_with_positional(arguments);
  arguments.add_option("--poses", entry.poses_file);
  try {
    arguments.parse(entry.arguments);
  } catch (const CLI::ParseError& error) {
    throw InvalidArgument(std::string(error.what()) + ": write NAME and the input as for egosgm run");
  }
  return entry;
}

}  // namespace

std::vector<BatchEntry> read_batch_list(const std::filesystem::path& file) {
  std::istringstream text(vision::read_file(file, kMaxListBytes));
  std::vector<BatchEntry> entries;
  std::set<std::string> names;
  int number = 0;
  for (std::string raw; std::getline(text, raw);) {
    ++number;
    const std::string line = stripped(raw);
    if (line.empty()) continue;
    try {
      entries.push_back(parse(line));
    } catch (const InvalidArgument& error) {
      throw InvalidArgument(fmt::format("{}, line {}: {}", file.string(), number, error.what()));
    }
    if (!names.insert(entries.back().name).second) {
      throw InvalidArgument(fmt::format("{}, line {}: the name {} comes twice: results would overwrite each other",
                                        file.string(), number, entries.back().name));
    }
  }
  if (entries.empty()) {
    throw InvalidArgument(file.string() + ": names no sequence: write a line each, NAME and the input");
  }
  return entries;
}

}  // namespace egosgm::app
