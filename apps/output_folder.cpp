// SPDX-License-Identifier: Apache-2.0
#include "apps/output_folder.h"

#include <fmt/core.h>

#include <algorithm>
#include <limits>

#include "apps/run_sequence.h"
#include "egosgm/error.h"
#include "host/json_text.h"
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Files of all frames, which a run that stops writes up to there.
const std::set<std::string> kGrowing{"poses.txt", kRunObjects};

constexpr std::size_t kAnySize = std::numeric_limits<std::size_t>::max() - 1;

/// Resolves a path, also one that is not there yet. A pipe of this process is in no folder: it keeps its name.
fs::path place_of(const fs::path& path) {
  std::error_code error;
  if (fs::is_fifo(path, error)) return fs::absolute(path);
  fs::path result = fs::weakly_canonical(fs::absolute(path), error);
  if (error) throw InvalidArgument(fmt::format("{}: {}: give another path", path.string(), error.message()));
  return result.has_filename() ? result : result.parent_path();
}

/// Resolves the folder of a file's name, which may be a link.
fs::path place_of_name(const std::string& file) {
  return place_of(fs::absolute(file).parent_path()) / fs::path(file).filename();
}

bool is_within(fs::path path, const fs::path& folder) {
  std::error_code none;  // what is not there is nobody's folder
  for (;; path = path.parent_path()) {
    if (path == folder || (fs::exists(path, none) && fs::equivalent(path, folder, none))) return true;
    if (path == path.parent_path()) return false;
  }
}

bool is_there(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::symlink_status(path, error);
  if (status.type() == fs::file_type::none) {
    throw IoError(fmt::format("{}: cannot be looked at: {}; choose another folder", path.string(), error.message()));
  }
  return fs::exists(status);
}

/// Throws InvalidArgument where something is there that is no folder, and IoError where it cannot be read.
bool is_new_or_empty(const std::string& option, const std::string& shown, const fs::path& path) {
  if (!is_there(path)) return true;
  std::error_code error;
  if (fs::is_symlink(fs::symlink_status(path, error)) && !fs::exists(path, error)) {
    throw InvalidArgument(fmt::format("{} {}: is a link that leads nowhere: give a new folder", option, shown));
  }
  const bool is_folder = fs::is_directory(path, error);
  const bool is_empty = is_folder && fs::is_empty(path, error);
  if (error) throw IoError(fmt::format("{} {}: {}; choose another folder", option, shown, error.message()));
  if (!is_folder) throw InvalidArgument(fmt::format("{} {}: is no folder: give a new folder", option, shown));
  return is_empty;
}

bool is_regular(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(fs::symlink_status(path, none));
}

/// A frame's name is its number or its time.
bool is_map(const fs::path& file) {
  const std::string stem = file.stem().string();
  return !stem.empty() && file.has_extension() && stem.find_first_not_of("0123456789.") == std::string::npos;
}

std::set<std::string> folders_of(const std::set<std::string>& files) {
  std::set<std::string> folders;
  for (const std::string& file : files) folders.insert(fs::path(file).parent_path().string());
  folders.erase("");
  return folders;
}

/// Where a shell left it, as in --out=~/result.
void expect_no_home_sign(const std::string& option, const fs::path& path) {
  std::error_code none;
  if (path.empty() || *path.begin() != "~" || fs::exists("~", none)) return;
  throw InvalidArgument(option + " " + path.string() +
                        ": a shell alone knows ~ as the home folder: write its path out");
}

void expect_named(const std::string& option, const std::string& path) {
  if (path.empty()) throw InvalidArgument(option + " \"\": give a name");
  expect_no_home_sign(option, path);
}

/// Names of the frames whose pairs an earlier run could not read.
std::set<std::string> names_left_out(const Json& report) {
  std::set<std::string> names;
  const auto left_out = report.find("left_out");
  if (left_out == report.end() || !left_out->is_array()) return names;
  for (const Json& pair : *left_out) {
    if (const Json name = pair.is_object() ? pair.value("name", Json()) : Json(); name.is_string()) names.insert(name);
  }
  return names;
}

/// Throws InvalidArgument, naming the first figure in which the run that is recorded in `folder` differs.
void expect_same(const std::string& folder, const Json& earlier, const Json& identity) {
  const Json flat = as_in_file(identity).flatten(), flat_earlier = earlier.flatten();
  for (const auto& [name, value] : flat.items()) {
    const auto found = flat_earlier.find(name);
    const Json before = found == flat_earlier.end() ? Json() : *found;
    if (before == value) continue;
    throw InvalidArgument(
        fmt::format("--resume: the run in {} had {} = {}, this one has {}: give what it was given, or another --out",
                    folder, name.substr(1), before.dump(), value.dump()));
  }
}

}  // namespace

fs::path new_folder(const std::string& option, const std::string& folder) {
  expect_named(option, folder);
  fs::path path = place_of(folder);
  if (!is_new_or_empty(option, folder, path)) {
    throw InvalidArgument(fmt::format("{} {}: is not empty: give a new folder", option, folder));
  }
  return path;
}

void expect_no_folder(const std::string& option, const fs::path& file) {
  expect_no_home_sign(option, file);
  std::error_code none;
  if (!file.has_filename() || fs::is_directory(file, none))
    throw InvalidArgument(option + " " + file.string() + ": is a folder: give the name of a file");
}

void expect_new_file(const std::string& option, const std::string& file) {
  expect_named(option, file);
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  expect_no_folder(option, file);
  if (fs::is_regular_file(status) && !vision::is_stream(file)) {
    throw InvalidArgument(option + " " + file + ": is there already: give another name, or remove it first");
  }
  vision::expect_writable(file);
}

void expect_outside(const std::string& option, const std::string& file, const fs::path& folder) {
  if (file.empty()) return;
  const fs::path place = place_of(folder), path = place_of_name(file);
  if (!is_within(path, place) && !is_within(place, path)) return;
  throw InvalidArgument(
      fmt::format("{} {}: lies in {}, where this command writes, or is that folder: give another name", option, file,
                  folder.string()));
}

OutputFolder::OutputFolder(const std::string& folder, bool resume, const std::vector<std::string>& planned)
    : shown_(folder), resume_(resume), planned_(planned.begin(), planned.end()) {
  expect_named("--out", folder);
  path_ = place_of(folder);
  look();
}

void OutputFolder::look() {
  if (is_new_or_empty("--out", shown_, path_)) return;
  if (!resume_) {
    const bool is_of_a_run = is_there(path_ / "report.json");
    throw InvalidArgument(
        fmt::format("--out {}: is not empty: give a new folder{}", shown_,
                    is_of_a_run ? ", or --resume to go on with the run that lies there; a run that is not wanted any "
                                  "more can be removed by hand"
                                : ""));
  }
  const fs::path file = path_ / "report.json";
  if (!is_regular(file)) {
    throw InvalidArgument(
        fmt::format("--resume: {} has no report.json, which says how a run was made: give another --out", shown_));
  }
  earlier_ = parse_json(vision::read_file(file, kMaxJsonBytes), file);
  if (!earlier_.is_object() || earlier_.value("program", Json()) != "egosgm") {
    throw InvalidArgument(fmt::format("--resume: {} is no report of a run: give another --out", file.string()));
  }
  expect_maps_of_this_run();
  const std::set<std::string> left_out = names_left_out(earlier_);
  lacks_nothing_ = earlier_.value("finished", Json()) == true &&
                   std::all_of(planned_.begin(), planned_.end(), [&](const fs::path& file) {
                     return is_there(path_ / file) || left_out.contains(file.stem().string());
                   });
}

/// A run that goes on loses no frame, and maps of two runs do not mix.
void OutputFolder::expect_maps_of_this_run() const {
  std::set<std::string> files = planned_;
  files.insert(kGrowing.begin(), kGrowing.end());
  for (const std::string& name : files) {
    if (!is_there(path_ / name) || is_regular(path_ / name)) continue;
    throw InvalidArgument(
        fmt::format("--resume: {} is a link or no file: give another --out", (path_ / name).string()));
  }
  std::set<std::string> others;
  for (const std::string& folder : folders_of(planned_)) {
    const fs::path path = path_ / folder;
    if (!is_there(path)) continue;
    std::error_code error;
    if (!fs::is_directory(fs::symlink_status(path, error))) {
      throw InvalidArgument(fmt::format("--resume: {} is {}: give another --out", path.string(),
                                        fs::is_symlink(path, error) ? "a link" : "no folder"));
    }
    for (fs::directory_iterator file(path, error), end; !error && file != end; file.increment(error)) {
      const std::string name = folder + '/' + file->path().filename().string();
      if (is_map(file->path()) && !planned_.contains(name)) others.insert(name);
    }
    if (error) throw IoError(path.string() + ": cannot be read: " + error.message() + "; choose another --out");
  }
  if (others.empty()) return;
  throw InvalidArgument(fmt::format("--resume: {} holds {}, which this run would not write: give the frames {}", shown_,
                                    *others.begin(), "that it was given, or another --out"));
}

fs::path OutputFolder::named_file(const std::string& option, const std::string& file) {
  if (file.empty()) return {};
  const fs::path path = place_of_name(file);
  if (is_within(path_, path)) throw InvalidArgument(option + " " + file + ": is a folder: give the name of a file");
  const std::string name = path.lexically_relative(path_).string();
  if (name == "report.json" || kGrowing.contains(name) || planned_.contains(name) ||
      folders_of(planned_).contains(name)) {
    throw InvalidArgument(option + " " + file + ": is what the run writes itself: give another name");
  }
  if (!named_.insert(path.string()).second) {
    throw InvalidArgument(option + " " + file + ": another option names it, too");
  }
  // The run makes its own folder.
  if (path.parent_path() != path_ || is_there(path_)) expect_new_file(option, file);
  return vision::is_stream(file) ? fs::path(file) : path;
}

void OutputFolder::begin(Json identity) {
  is_made_ = !is_there(path_);
  vision::make_folder(path_);
  if (!goes_on()) return;
  // One that lost its device went on elsewhere, with the same bits.
  const Json fallback = earlier_.value("fallback", Json());
  if (fallback.is_object() && identity.contains("device") &&
      fallback.value("from", Json()) == as_in_file(identity["device"])) {
    identity.erase("device");
  }
  expect_same(shown_, earlier_, identity);
}

void OutputFolder::expect_no_other_run() const {
  if (is_there(path_ / "report.json"))
    throw IoError(fmt::format("--out {}: another run has begun there meanwhile: choose another folder", shown_));
}

void OutputFolder::leave_nothing() const {
  if (goes_on()) return;
  std::error_code none;  // a folder with a file stays
  for (const char* file : {"report.json", kRunCalibration}) fs::remove(path_ / file, none);
  for (const std::string& folder : folders_of(planned_)) fs::remove(path_ / folder, none);
  if (is_made_) fs::remove(path_, none);
}

bool OutputFolder::is_to_write(const fs::path& file, std::string_view bytes) const {
  const std::string name = file.lexically_relative(path_).string();
  if (lacks_nothing_ && planned_.contains(name) && !is_there(file)) {
    throw InvalidArgument(
        fmt::format("--resume: {} was left out by the run that finished, and its pair can be read this time: give "
                    "another --out",
                    file.string()));
  }
  if (!(planned_.contains(name) || kGrowing.contains(name)) || !is_there(file)) return true;
  const std::string earlier = is_regular(file) ? vision::read_file(file, kAnySize) : std::string();
  if (earlier == bytes) return false;
  if (!goes_on() || !is_regular(file)) {
    throw IoError(file.string() + ": has come there while the run wrote, and stays: choose another --out");
  }
  // A run that stopped wrote them up to there.
  if (kGrowing.contains(name) && bytes.starts_with(earlier)) return true;
  if (kGrowing.contains(name) && earlier.starts_with(bytes)) return false;
  throw InvalidArgument(fmt::format(
      "--resume: {} is not what this run makes of the frame, so it was changed, or what this run reads was: "
      "give another --out",
      file.string()));
}

}  // namespace egosgm::app
