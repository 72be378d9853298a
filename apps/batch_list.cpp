// SPDX-License-Identifier: Apache-2.0
#include "apps/batch_list.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <sstream>

#include "apps/file_record.h"
#include "apps/run_outputs.h"
#include "egosgm/error.h"
#include "host/vision/file_io.h"
#include "host/vision/text_rows.h"

namespace egosgm::app {
namespace {

constexpr std::size_t kMaxListBytes = std::size_t{1} << 30;  // a million sequences take a tenth
constexpr const char* kBlanks = " \t\r";

std::string stripped(std::string line) {
  line = vision::without_comment(line);
  line.erase(0, std::min(line.find_first_not_of(kBlanks), line.size()));
  line.erase(line.find_last_not_of(kBlanks) + 1);
  return line;
}

/// Letters, digits and a few signs, in folders of folders; no part begins with a dot.
bool is_folder_name(const std::string& name) {
  const auto is_fit = [](unsigned char c) {
    return std::isalnum(c) || c == '.' || c == '_' || c == '-' || c == '+' || c == '/';
  };
  const std::string framed = '/' + name + '/';
  return std::all_of(name.begin(), name.end(), is_fit) && framed.find("/.") == std::string::npos &&
         framed.find("//") == std::string::npos;
}

/// Letters of either case name one file on some file systems.
std::string lowered(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

/// The part of a name that a batch or a run writes files to; empty where there is none.
std::string reserved_part(const std::string& name) {
  const std::vector<std::string> folders = output_folders();
  std::istringstream parts(lowered(name));
  for (std::string part; std::getline(parts, part, '/');) {
    const bool is_file = part.ends_with(".json") || part == "report.html" || part == "poses.txt" || part == kFileRecord;
    if (is_file || std::find(folders.begin(), folders.end(), part) != folders.end()) return part;
  }
  return {};
}

BatchEntry split(const std::string& line, const std::string& place) {
  const auto end = std::min(line.find_first_of(kBlanks), line.size());
  const std::string name = line.substr(0, end);
  if (!is_folder_name(name)) {
    throw InvalidArgument(
        fmt::format("{}: name \"{}\": choose letters, digits and . _ + - /, not beginning with a dot; "
                    "then the input",
                    place, name));
  }
  if (const std::string part = reserved_part(name); !part.empty()) {
    throw InvalidArgument(fmt::format("{}: name \"{}\": results have files or folders of the name {}: choose another",
                                      place, name, part));
  }
  return {name, stripped(line.substr(end)), place};
}

}  // namespace

std::vector<BatchEntry> read_batch_list(const std::filesystem::path& file) {
  const std::string text = vision::read_file(file, kMaxListBytes);
  std::vector<BatchEntry> entries;
  std::set<std::string> names;
  for (const vision::TextRow& row : vision::split_rows(text, file)) {
    const std::string line = stripped(std::string(row.text));
    if (line.empty()) continue;
    entries.push_back(split(line, fmt::format("{}, line {}", file.string(), row.number)));
    if (!names.insert(lowered(entries.back().name)).second) {
      throw InvalidArgument(fmt::format("{}: the name {} comes twice: results would overwrite each other",
                                        entries.back().place, entries.back().name));
    }
  }
  for (const BatchEntry& entry : entries) {
    const std::string name = lowered(entry.name);
    for (std::size_t end = name.find('/'); end != std::string::npos; end = name.find('/', end + 1)) {
      if (!names.contains(name.substr(0, end))) continue;
      throw InvalidArgument(fmt::format("{}: the name {} lies in {}, which is a name, too: choose another", entry.place,
                                        entry.name, entry.name.substr(0, end)));
    }
  }
  if (entries.empty()) {
    throw InvalidArgument(file.string() + ": names no sequence: write a line each, NAME and the input");
  }
  return entries;
}

BatchInput parse_input(const BatchEntry& entry) {
  BatchInput input;
  CLI::App arguments;
  arguments.set_help_flag();  // none: a list has no one to read it
  input.sequence.add_to(arguments);
  arguments.add_option("--poses", input.poses_file);
  try {
    arguments.parse(entry.arguments);
  } catch (const CLI::ParseError& error) {
    throw InvalidArgument(fmt::format("{}: {}: write NAME and the input as for egosgm run", entry.place, error.what()));
  }
  return input;
}

}  // namespace egosgm::app
