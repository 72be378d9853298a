// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "apps/file_record.h"
#include "apps/sequence_arguments.h"
#include "egosgm/vision/dataset.h"

// Where the program may write. It replaces and removes only what it can prove to be its own:
// - In the folder of a run, what the folder's report.json lists, with the digest of each file that it wrote; while the
//   run is under way, and after a kill, the folder's FileRecord does so.
// - JSON and HTML of its own that ends with a digest of all before, so that a file that was edited is another one.
// Every other file that exists is in the way, and is refused before anything is written.

namespace egosgm::app {

/// The files and folders that a command reads.
class Inputs {
 public:
  Inputs() = default;
  /// The folders of images and truth, the calibration, and the data set's folder.
  Inputs(const SequenceArguments& arguments, const vision::StereoSequence& sequence);

  // An empty path adds nothing.
  void add_file(const std::filesystem::path& file);
  void add_folder(const std::filesystem::path& folder);

  /// Throws InvalidArgument where `folder` is an input's folder, lies in one, or holds an input: by whatever names.
  void expect_apart(const std::filesystem::path& folder) const;

 private:
  std::set<std::filesystem::path> files_, folders_;  // canonical
};

/// The folder of --out, which is to be new or empty. Throws InvalidArgument, having made nothing.
std::filesystem::path new_folder(const std::string& option, const std::string& folder, const Inputs& inputs);

/// Throws InvalidArgument where a regular file, or a folder, has the name that `option` gave, and IoError where none
/// can be written there. Pipes and devices are written through. An empty name is none.
void expect_new_file(const std::string& option, const std::string& file);

/// Throws InvalidArgument where `file`, which `option` names, lies in `folder`: what a command writes there it does not
/// know of.
void expect_outside(const std::string& option, const std::string& file, const std::filesystem::path& folder);

/// `text` and a last line that holds its digest, between `begin` and `end`.
std::string signed_text(const std::string& text, const std::string& begin, const std::string& end);
/// Whether the text is one of these, and as it was written.
bool is_signed(const std::string& text, const std::string& begin, const std::string& end);

/// JSON with a digest of itself, as text, and whether a text is such, and as it was written.
std::string signed_json(const nlohmann::ordered_json& json);
bool is_signed_json(const std::string& text);
/// Writes JSON with a digest of itself. Throws IoError.
void write_own_json(const std::filesystem::path& file, const nlohmann::ordered_json& json);
/// Throws InvalidArgument where the file exists and is not as write_own_json left it.
void expect_own_json(const std::filesystem::path& file);

// Around the digest of OUT/report.html, as `egosgm report` makes it.
constexpr const char *kPageDigestBegin = "<!-- egosgm report, digest ", *kPageDigestEnd = " -->\n";
/// Whether the file is such a page, as it was written.
bool is_own_page(const std::filesystem::path& file);

/// What becomes of what an earlier run left in OUT: it is in the way, it is removed, or it stays and the run goes on
/// after it.
enum class EarlierRun { kRefuse, kOverwrite, kResume };

/// The folder of a run, OUT, and what its report.json says of its files.
class OutputFolder {
 public:
  OutputFolder() = default;
  /// Looks at the folder, and changes nothing. `planned`: the maps that are to be written, relative to it. Throws
  /// InvalidArgument where a file is in the way: one that report.json does not list, or that was changed since. So it
  /// does where another run is writing there.
  OutputFolder(const std::string& folder, const Inputs& inputs, EarlierRun treatment,
               const std::vector<std::string>& planned);

  const std::filesystem::path& path() const { return path_; }
  bool resumes() const { return treatment_ == EarlierRun::kResume; }

  /// The file that `option` names, which may lie in OUT, and is one of the run's own then. An empty name is none.
  /// Throws InvalidArgument as expect_new_file does, and where the run writes that one anyway.
  std::filesystem::path named_file(const std::string& option, const std::string& file);

  /// Makes OUT ready, looking again: removes what the earlier run wrote, or throws InvalidArgument where that run's
  /// report differs in `identity` (RunReport::identity) from the one that is to go on. No other run begins there then.
  void begin(const nlohmann::ordered_json& identity);

  /// To be called before a file is written: the record has it before the disk. Returns whether it is to be written: of
  /// a run that goes on, what is there stays. Throws InvalidArgument where that has other bytes, and IoError where the
  /// file is another's.
  bool record(const std::filesystem::path& file, std::string_view bytes);
  /// To be called once report.json lists all files.
  void end();

  /// For "files" of report.json: pairs of a name and a digest.
  nlohmann::ordered_json files() const;

 private:
  void look();
  void read_report();
  void expect_frames_of_earlier() const;
  void expect_unchanged() const;
  void expect_room_for(const std::vector<std::string>& planned) const;
  void remove_earlier();

  std::filesystem::path path_;
  std::string shown_;  // as the user wrote it
  EarlierRun treatment_ = EarlierRun::kRefuse;
  std::vector<std::string> planned_;
  std::set<std::string> replaced_;            // by a run that goes on, too
  nlohmann::ordered_json earlier_;            // its report, null without one
  std::map<std::string, std::string> files_;  // digests by name
  std::shared_ptr<FileRecord> record_;        // while the run is under way
};

}  // namespace egosgm::app
