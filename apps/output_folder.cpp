// SPDX-License-Identifier: Apache-2.0
#include "apps/output_folder.h"

#include <fmt/core.h>
#include <sys/stat.h>

#include <algorithm>
#include <limits>

#include "egosgm/error.h"
#include "host/json_text.h"
#include "host/vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxReportBytes = std::size_t{1} << 30;
constexpr std::size_t kAnySize = std::numeric_limits<std::size_t>::max() - 1;
constexpr const char *kJsonDigestBegin = ",\n  \"digest\": \"", *kJsonDigestEnd = "\"\n}\n";

/// Where a path leads, also one that is not there yet. A pipe of this process is in no folder: it keeps its name.
fs::path place_of(const fs::path& path) {
  std::error_code error;
  if (fs::is_fifo(path, error)) return fs::absolute(path);
  fs::path result = fs::weakly_canonical(fs::absolute(path), error);
  if (error) throw InvalidArgument(fmt::format("{}: {}: give another path", path.string(), error.message()));
  return result.has_filename() ? result : result.parent_path();
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

bool is_regular(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(fs::symlink_status(path, none));
}

/// "disparity/000001.png": below the folder, without a detour.
bool is_plain_name(const std::string& name) {
  const fs::path path(name);
  return !name.empty() && path.is_relative() && path.lexically_normal() == path && path.has_filename() &&
         std::none_of(path.begin(), path.end(), [](const fs::path& part) { return part == ".." || part == "."; });
}

bool is_map(const fs::path& file) {
  const std::string stem = file.stem().string();
  return !stem.empty() && file.has_extension() && stem.find_first_not_of("0123456789") == std::string::npos;
}

bool is_own_json(const fs::path& file) {
  return is_regular(file) && is_signed_json(vision::read_file(file, kMaxReportBytes));
}

void remove_file(const fs::path& file) {
  std::error_code error;
  if (!fs::remove(file, error) && error) {
    throw IoError(file.string() + ": cannot be removed: " + error.message() + "; choose another --out");
  }
}

std::set<std::string> folders_of(const std::vector<std::string>& files) {
  std::set<std::string> folders;
  for (const std::string& file : files) {
    for (fs::path folder = fs::path(file).parent_path(); !folder.empty(); folder = folder.parent_path()) {
      folders.insert(folder.string());
    }
  }
  return folders;
}

void expect_named(const std::string& option, const std::string& path) {
  if (path.empty()) throw InvalidArgument(option + " \"\": give a name");
}

/// Throws InvalidArgument, naming the first figure in which the run that is recorded in `file` differs.
void expect_same(const std::string& folder, const Json& earlier, const Json& identity) {
  const Json flat = as_in_file(identity).flatten(), flat_earlier = earlier.flatten();
  for (const auto& [name, value] : flat.items()) {
    const auto found = flat_earlier.find(name);
    const Json before = found == flat_earlier.end() ? Json() : *found;
    if (before == value) continue;
    throw InvalidArgument(fmt::format(
        "--resume: the run in {} had {} = {}, this one has {}: give what it was given, or --overwrite to start anew",
        folder, name.substr(1), before.dump(), value.dump()));
  }
}

}  // namespace

Inputs::Inputs(const SequenceArguments& arguments, const vision::StereoSequence& sequence) {
  for (const std::string& folder : {arguments.kitti, arguments.odometry, arguments.folder}) add_folder(folder);
  std::set<fs::path> folders;
  for (const vision::StereoFrame& frame : sequence.frames) {
    for (const fs::path& file : {frame.left, frame.right, frame.truth_noc, frame.truth_occ}) {
      if (file.empty()) continue;
      folders.insert(fs::absolute(file).parent_path());
      std::error_code none;
      if (fs::is_symlink(file, none)) folders.insert(place_of(file).parent_path());
    }
  }
  for (const fs::path& folder : folders) add_folder(folder);
  add_file(sequence.calibration_file);
  add_file(sequence.poses_file);
}

void Inputs::add_file(const fs::path& file) {
  if (file.empty()) return;
  files_.insert(place_of(file));
  files_.insert(place_of(fs::absolute(file).parent_path()) / file.filename());  // a link is an input, too
}

void Inputs::add_folder(const fs::path& folder) {
  if (!folder.empty()) folders_.insert(place_of(folder));
}

void Inputs::expect_apart(const fs::path& folder) const {
  const fs::path out = place_of(folder);
  const auto refuse = [&](const char* how, const fs::path& input) {
    throw InvalidArgument(
        fmt::format("{}: {} {}: what is written must lie apart from what is read: give another folder", folder.string(),
                    how, input.string()));
  };
  for (const fs::path& input : folders_) {
    if (is_within(out, input)) refuse("is, or lies in, the input's folder", input);
    if (is_within(input, out)) refuse("holds the input's folder", input);
  }
  for (const fs::path& input : files_) {
    if (is_within(input.parent_path(), out)) refuse("holds the input", input);
  }
}

fs::path new_folder(const std::string& option, const std::string& folder, const Inputs& inputs) {
  expect_named(option, folder);
  inputs.expect_apart(folder);
  fs::path path = place_of(folder);
  std::error_code error;
  if (is_there(path) && !(fs::is_directory(path, error) && fs::is_empty(path, error))) {
    if (error) throw IoError(fmt::format("{} {}: {}; choose another folder", option, folder, error.message()));
    throw InvalidArgument(fmt::format("{} {}: is {}: give a new folder", option, folder,
                                      fs::is_directory(path, error) ? "not empty" : "no folder"));
  }
  return path;
}

void expect_new_file(const std::string& option, const std::string& file) {
  expect_named(option, file);
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (fs::is_directory(status)) throw InvalidArgument(option + " " + file + ": is a folder: give the name of a file");
  if (fs::is_regular_file(status) && !vision::is_stream(file)) {
    throw InvalidArgument(option + " " + file + ": is there already: give another name, or remove it first");
  }
  vision::expect_writable(file);
}

void expect_outside(const std::string& option, const std::string& file, const fs::path& folder) {
  if (file.empty()) return;
  const fs::path place = place_of(folder),
                 path = place_of(fs::absolute(file).parent_path()) / fs::path(file).filename();
  if (!is_within(path, place) && !is_within(place, path)) return;
  throw InvalidArgument(
      fmt::format("{} {}: lies in {}, where this command writes, or is that folder: give another name", option, file,
                  folder.string()));
}

std::string signed_text(const std::string& text, const std::string& begin, const std::string& end) {
  return text + begin + digest_of(text) + end;
}

bool is_signed(const std::string& text, const std::string& begin, const std::string& end) {
  const std::size_t at = text.rfind(begin);
  if (at == std::string::npos) return false;
  return text.compare(at, std::string::npos, begin + digest_of(std::string_view(text).substr(0, at)) + end) == 0;
}

bool is_own_page(const fs::path& file) {
  return is_regular(file) && is_signed(vision::read_file(file, kMaxReportBytes), kPageDigestBegin, kPageDigestEnd);
}

std::string signed_json(const Json& json) {
  std::string text = dumped(json, 2);
  text.resize(text.size() - 2);  // "\n}"
  return signed_text(text, kJsonDigestBegin, kJsonDigestEnd);
}

bool is_signed_json(const std::string& text) { return is_signed(text, kJsonDigestBegin, kJsonDigestEnd); }

void write_own_json(const fs::path& file, const Json& json) { vision::write_file(file, signed_json(json)); }

void expect_own_json(const fs::path& file) {
  if (!is_there(file) || is_own_json(file)) return;
  throw InvalidArgument(file.string() +
                        ": is not as egosgm wrote it, or not its file at all, and stays: choose another --out");
}

OutputFolder::OutputFolder(const std::string& folder, const Inputs& inputs, EarlierRun treatment,
                           const std::vector<std::string>& planned)
    : shown_(folder), treatment_(treatment), planned_(planned) {
  planned_.emplace_back("poses.txt");
  replaced_.insert("poses.txt");
  expect_named("--out", folder);
  inputs.expect_apart(folder);
  path_ = place_of(folder);
  std::error_code none;
  if (is_there(path_) && !fs::is_directory(path_, none)) vision::make_folder(path_);  // says what is wrong
  look();
}

void OutputFolder::look() {
  files_.clear();
  earlier_ = Json();
  const std::map<std::string, std::string> recorded = record_ ? record_->files() : recorded_files(path_);
  read_report();
  for (const auto& [name, digest] : recorded) files_[name] = digest;
  const bool holds_a_run = !earlier_.is_null() || !files_.empty();
  if (holds_a_run && treatment_ == EarlierRun::kRefuse) {
    throw InvalidArgument(fmt::format(
        "--out {}: holds an earlier run: give --resume to go on with it, --overwrite to replace it, or another folder",
        shown_));
  }
  if (holds_a_run && earlier_.is_null() && resumes()) {
    throw InvalidArgument(fmt::format(
        "--resume: {} has no report.json, which says how that run was made: give --overwrite to start anew", shown_));
  }
  if (resumes()) expect_frames_of_earlier();
  expect_unchanged();
  expect_room_for(planned_);
}

/// A run that goes on loses no frame.
void OutputFolder::expect_frames_of_earlier() const {
  const std::set<std::string> planned(planned_.begin(), planned_.end());
  for (const auto& [name, digest] : files_) {
    if (!name.starts_with("disparity/") || planned.contains(name)) continue;
    throw InvalidArgument(fmt::format("--resume: {} holds {}, which this run would not write: give the frames {}",
                                      shown_, name, "that it was given, or --overwrite to start anew"));
  }
}

fs::path OutputFolder::named_file(const std::string& option, const std::string& file) {
  if (file.empty()) return {};
  const fs::path path = place_of(fs::absolute(file).parent_path()) / fs::path(file).filename();
  std::error_code none;
  if (is_within(path_, path)) throw InvalidArgument(option + " " + file + ": is a folder: give the name of a file");
  const std::string name = path.lexically_relative(path_).string();
  if (!is_plain_name(name) || fs::is_symlink(path, none) || vision::is_stream(path)) {
    expect_new_file(option, file);
    return file;
  }
  const std::set<std::string> folders = folders_of(planned_);
  if (name == "report.json" || name == kFileRecord || folders.contains(name) ||
      std::find(planned_.begin(), planned_.end(), name) != planned_.end()) {
    throw InvalidArgument(option + " " + file + ": is what the run writes itself: give another name");
  }
  const bool is_new_folders = path.parent_path() == path_ && !is_there(path_);
  if (!is_new_folders && !files_.contains(name)) expect_new_file(option, file);
  if (name.find('\n') != name.npos) throw InvalidArgument(option + " " + file + ": give a name of one line");
  if (!replaced_.insert(name).second) throw InvalidArgument(option + " " + file + ": another option names it, too");
  return path;
}

void OutputFolder::read_report() {
  const fs::path file = path_ / "report.json";
  if (!is_there(file)) return;
  if (is_regular(file)) earlier_ = parse_json(vision::read_file(file, kMaxReportBytes), file);
  expect_own_json(file);
  const auto refuse = [&](const std::string& why) {
    throw InvalidArgument(fmt::format("{}: {}: nothing there is replaced; choose another --out", file.string(), why));
  };
  if (!earlier_.is_object() || !earlier_.contains("files") || !earlier_["files"].is_array()) {
    refuse("does not list what the run wrote");
  }
  for (const Json& entry : earlier_["files"]) {
    if (!entry.is_array() || entry.size() != 2 || !entry[0].is_string()) refuse("does not list what the run wrote");
    const std::string name = entry[0];
    const Json& digest = entry[1];
    if (!is_plain_name(name) || name == "report.json") refuse("lists \"" + name + "\", which is no file of a run");
    if (!digest.is_string()) refuse("has no digest of " + name);
    files_[name] = digest;
  }
}

void OutputFolder::expect_unchanged() const {
  for (const auto& [name, digest] : files_) {
    const fs::path file = path_ / name;
    if (!is_there(file)) continue;
    if (is_regular(file) && digest == digest_of(vision::read_file(file, kAnySize))) continue;
    throw InvalidArgument(
        fmt::format("{}: is not as the run wrote it: move it away, or choose another --out", file.string()));
  }
}

void OutputFolder::expect_room_for(const std::vector<std::string>& planned) const {
  const auto refuse = [&](const fs::path& file) {
    throw InvalidArgument(
        fmt::format("--out {}: {} is there, and no report.json beside says that a run wrote it: choose another folder",
                    shown_, file.string()));
  };
  std::vector<std::string> all = planned;
  for (const auto& [name, digest] : files_) all.push_back(name);
  for (const std::string& folder : folders_of(all)) {
    const fs::path path = path_ / folder;
    if (!is_there(path)) continue;
    std::error_code error;
    if (!fs::is_directory(fs::symlink_status(path, error))) {
      throw InvalidArgument(fmt::format("--out {}: {} is {}: choose another folder", shown_, path.string(),
                                        fs::is_symlink(path, error) ? "a link" : "no folder"));
    }
    // Maps of two runs do not mix.
    for (fs::directory_iterator file(path, error), end; !error && file != end; file.increment(error)) {
      const std::string name = folder + '/' + file->path().filename().string();
      if (is_map(file->path()) && !files_.contains(name)) refuse(file->path());
    }
    if (error) throw IoError(path.string() + ": cannot be read: " + error.message() + "; choose another --out");
  }
  for (const std::string& name : planned) {
    if (!files_.contains(name) && is_there(path_ / name)) refuse(path_ / name);
  }
}

void OutputFolder::begin(const Json& identity) {
  vision::make_folder(path_);
  record_ = std::make_shared<FileRecord>(path_);
  try {
    look();
    if (resumes() && !earlier_.is_null()) expect_same(shown_, earlier_, identity);
  } catch (const std::exception&) {
    if (record_->files().empty()) record_->remove();  // it was none before
    throw;
  }
  if (treatment_ == EarlierRun::kOverwrite) remove_earlier();
  earlier_ = Json();
  for (const std::string& name : replaced_) {
    if (files_.erase(name) > 0) remove_file(path_ / name);
  }
}

void OutputFolder::remove_earlier() {
  std::vector<std::string> names;
  for (const auto& [name, digest] : files_) {
    remove_file(path_ / name);
    names.push_back(name);
  }
  const std::set<std::string> folders = folders_of(names);
  std::error_code not_empty;
  for (auto folder = folders.rbegin(); folder != folders.rend(); ++folder) fs::remove(path_ / *folder, not_empty);
  // What others made of that run.
  if (is_own_page(path_ / "report.html")) remove_file(path_ / "report.html");
  if (is_own_json(path_ / "done.json")) remove_file(path_ / "done.json");
  files_.clear();
  record_->clear();
}

bool OutputFolder::record(const fs::path& file, std::string_view bytes) {
  const std::string name = file.lexically_relative(path_).string();
  if (!is_plain_name(name) || name == "report.json") return true;
  const std::string digest = digest_of(bytes);
  if (is_there(file)) {
    const auto earlier = files_.find(name);
    if (earlier == files_.end()) {
      throw IoError(file.string() + ": has come there while the run wrote, and stays: choose another --out");
    }
    if (earlier->second == digest) return false;
    throw InvalidArgument(
        fmt::format("--resume: {} is not what this run makes of the frame, so what it reads is not "
                    "what it was: give --overwrite to start anew",
                    file.string()));
  }
  record_->add(name, digest);
  files_[name] = digest;
  return true;
}

void OutputFolder::end() { record_->remove(); }

Json OutputFolder::files() const {
  Json json = Json::array();  // an object of so many keys is refused by readers
  for (const auto& [name, digest] : files_) json.push_back({name, digest});
  return json;
}

}  // namespace egosgm::app
