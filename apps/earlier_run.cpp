// SPDX-License-Identifier: Apache-2.0
#include "apps/earlier_run.h"

#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <vector>

#include "apps/run_outputs.h"
#include "egosgm/error.h"
#include "egosgm/vision/file_io.h"
#include "host/json_text.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxReportBytes = std::size_t{1} << 30;

bool is_map(const fs::path& file) {
  const std::string stem = file.stem().string();
  return (file.extension() == ".png" || file.extension() == ".pfm") && !stem.empty() &&
         stem.find_first_not_of("0123456789") == std::string::npos;
}

/// Maps that a run left in `out`: files named by a frame's number in the folders that runs write.
std::vector<fs::path> maps_in(const fs::path& out) {
  std::vector<fs::path> maps;
  for (const std::string& folder : output_folders()) {
    std::error_code none;  // no such folder
    for (fs::directory_iterator file(out / folder, none), end; !none && file != end; file.increment(none)) {
      if (is_map(file->path())) maps.push_back(file->path());
    }
  }
  return maps;
}

void remove_file(const fs::path& file) {
  std::error_code error;
  if (!fs::remove(file, error) && error) {
    throw IoError(file.string() + ": cannot be removed: " + error.message() + "; choose another --out");
  }
}

/// Throws InvalidArgument, naming the first figure in which the run that is recorded in `file` differs.
void expect_same(const fs::path& file, const Json& identity) {
  const Json earlier = parse_json(vision::read_file(file, kMaxReportBytes), file);
  if (!earlier.is_object()) {
    throw InvalidArgument(file.string() + ": not the report of a run: give --overwrite to start anew");
  }
  const Json flat = identity.flatten(), flat_earlier = earlier.flatten();
  for (const auto& [name, value] : flat.items()) {
    const auto found = flat_earlier.find(name);
    const Json before = found == flat_earlier.end() ? Json() : *found;
    if (before == value) continue;
    throw InvalidArgument(fmt::format(
        "--resume: the run in {} had {} = {}, this one has {}: give what it was given, or --overwrite to start anew",
        file.parent_path().string(), name.substr(1), before.dump(), value.dump()));
  }
}

}  // namespace

void expect_free(const fs::path& out, EarlierRun treatment, const Json& identity) {
  const fs::path report = out / "report.json";
  const std::vector<fs::path> maps = maps_in(out);
  const bool has_report = fs::exists(report);
  if (maps.empty() && !has_report) return;
  switch (treatment) {
    case EarlierRun::kRefuse:
      throw InvalidArgument(
          fmt::format("--out {}: holds an earlier run: give --resume to go on with it, --overwrite to replace it, or "
                      "another folder",
                      out.string()));
    case EarlierRun::kResume:
      if (!has_report) {
        throw InvalidArgument(fmt::format(
            "--resume: {} has maps, but no report.json to say how they were made: give --overwrite to start anew",
            out.string()));
      }
      return expect_same(report, identity);
    case EarlierRun::kOverwrite:
      remove_file(report);  // first: maps without it are never taken for those of another run
      remove_file(out / "poses.txt");
      remove_file(out / "report.html");
      std::for_each(maps.begin(), maps.end(), remove_file);
  }
}

}  // namespace egosgm::app
