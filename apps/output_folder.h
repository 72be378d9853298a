// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

// Decides whether the program may write to a place. It deletes nothing, and it replaces nothing but the report and the
// poses of a run that goes on: a folder is new or empty, or holds a run that --resume names, and a file is new.

namespace egosgm::app {

/// The folder of `option`, which is to be new or empty. Throws InvalidArgument, having made nothing.
std::filesystem::path new_folder(const std::string& option, const std::string& folder);

/// Throws InvalidArgument where `file`, which `option` names, is a folder, or one by the slash at its end.
void expect_no_folder(const std::string& option, const std::filesystem::path& file);

/// Throws InvalidArgument where a regular file, or a folder, has the name that `option` gave, and IoError where none
/// can be written there. Pipes and devices are written through. An empty name is none.
void expect_new_file(const std::string& option, const std::string& file);

/// Throws InvalidArgument where `file`, which `option` names, lies in `folder`: what a command writes there it does not
/// know of.
void expect_outside(const std::string& option, const std::string& file, const std::filesystem::path& folder);

/// The folder of a run, OUT.
class OutputFolder {
 public:
  OutputFolder() = default;
  /// Looks at the folder, and changes nothing. `planned`: the maps that are to be written, relative to it. Throws
  /// InvalidArgument unless the folder is new or empty, or `resume` is set and its report.json is a run's that wrote no
  /// other maps.
  OutputFolder(const std::string& folder, bool resume, const std::vector<std::string>& planned);

  const std::filesystem::path& path() const { return path_; }

  /// Whether the run that is to go on had finished, and wrote all that this one would, but what it could not read.
  bool lacks_nothing() const { return lacks_nothing_; }

  /// Whether a run lay there when this looked, which is to go on.
  bool goes_on() const { return !earlier_.is_null(); }

  /// Throws IoError where a report lies there, which of a new run is another one's.
  void expect_no_other_run() const;

  /// The file that `option` names, which may lie in OUT. An empty name is none. Throws InvalidArgument as
  /// expect_new_file does, and where the run writes that one anyway.
  std::filesystem::path named_file(const std::string& option, const std::string& file);

  /// Makes OUT. Throws InvalidArgument where the run that is there differs in `identity` (RunReport::identity) from the
  /// one that is to go on.
  void begin(nlohmann::ordered_json identity);

  /// Removes what a run that wrote no frame has made: its report, empty folders, and OUT, unless that was there.
  void leave_nothing() const;

  /// To be called before a file is written. Returns whether it is to be written: of a run that goes on, what is there
  /// stays. Throws InvalidArgument where that has other bytes, and IoError where another put it there meanwhile.
  bool is_to_write(const std::filesystem::path& file, std::string_view bytes) const;

 private:
  void look();
  void expect_maps_of_this_run() const;

  std::filesystem::path path_;
  std::string shown_;  // as the user wrote it
  bool resume_ = false, lacks_nothing_ = false, is_made_ = false;
  std::set<std::string> planned_, named_;
  nlohmann::ordered_json earlier_;  // the report of the run that goes on, null without one
};

}  // namespace egosgm::app
