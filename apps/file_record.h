// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "egosgm/error.h"

namespace egosgm::app {

/// Of a file's bytes.
std::string digest_of(std::string_view bytes);

/// The name, in its folder, of the record that a run keeps while it is under way: a line a file, with its digest,
/// before the file is there. Each line also has a digest of all lines before, so that a record that was edited is no
/// longer one. A kill leaves it behind, as the proof of what the run wrote until then.
constexpr const char* kFileRecord = "files.part";

/// What a run that was killed recorded in `folder`: digests by name; nothing without a record. Throws InvalidArgument
/// where the record is not as it was written, or where a run is still writing to it.
std::map<std::string, std::string> recorded_files(const std::filesystem::path& folder);

/// Another process is writing to the folder.
class FolderInUse : public InvalidArgument {
 public:
  using InvalidArgument::InvalidArgument;
};

/// A file or a folder that no other process has, with a lock that goes with the process.
class LockedFile {
 public:
  /// Throws FolderInUse, naming the folder that `file` is in, where another has it.
  LockedFile(const std::filesystem::path& file, int flags, int lock);
  ~LockedFile();
  LockedFile(const LockedFile&) = delete;
  LockedFile& operator=(const LockedFile&) = delete;
  int descriptor() const { return descriptor_; }

 private:
  const int descriptor_;
};

/// The record of the run that is under way, which no other process can open as long as this object lives.
class FileRecord {
 public:
  /// Goes on with the folder's record, or begins one. Throws InvalidArgument, as recorded_files does, and IoError.
  explicit FileRecord(const std::filesystem::path& folder);

  const std::map<std::string, std::string>& files() const { return files_; }

  /// Forgets all.
  void clear();
  /// Throws IoError.
  void add(const std::string& name, const std::string& digest);
  /// Removes it: another file says the same now.
  void remove();

 private:
  void write(std::string_view text) const;

  const std::filesystem::path file_;
  std::unique_ptr<LockedFile> opened_;
  std::string chain_;
  std::map<std::string, std::string> files_;
};

}  // namespace egosgm::app
