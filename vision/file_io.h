// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "egosgm/export.h"

namespace egosgm::vision {

/// Reads a whole file. Throws InvalidArgument, naming the file and the system's reason, where it cannot be read, is a
/// folder or a device, or holds more than `max_bytes`. Thread-safe.
EGOSGM_EXPORT std::string read_file(const std::filesystem::path& file, std::size_t max_bytes);

/// Reads at most the first `bytes` bytes of a file; throws as read_file does. Thread-safe.
EGOSGM_EXPORT std::string read_file_start(const std::filesystem::path& file, std::size_t bytes);

/// Writes a whole file or none: the bytes go into an unnamed (or, where the file system has none, hidden) file in the
/// same folder, which then takes the name in one step. A crash, a kill or a full disk leaves the old file as it was.
/// Links are followed, the mode of an old file is kept, and one that may not be written to is not replaced. What is no
/// regular file (a pipe, a terminal, /dev/stdout) is written through; a disk is refused. Not flushed to the medium: a
/// power cut may lose it. Throws IoError. Thread-safe for different files.
EGOSGM_EXPORT void write_file(const std::filesystem::path& file, std::string_view bytes);

/// While it lives, `before` is called by each write_file of its thread with the file and its bytes, before the file has
/// them: for a record of files that is never behind them. It returns whether the file is to be written; what it throws
/// ends the write. The last one made counts.
class EGOSGM_EXPORT BeforeWrite {
 public:
  using Function = std::function<bool(const std::filesystem::path& file, std::string_view bytes)>;
  explicit BeforeWrite(Function before);
  ~BeforeWrite();
  BeforeWrite(const BeforeWrite&) = delete;
  BeforeWrite& operator=(const BeforeWrite&) = delete;

 private:
  const Function before_;
  const BeforeWrite* const outer_;
  friend EGOSGM_EXPORT void write_file(const std::filesystem::path& file, std::string_view bytes);
};

/// While it lives, write_file of its thread replaces no file, and throws IoError where one has come: for
/// what takes a while after its name was found free. What is no regular file is written through as ever.
class EGOSGM_EXPORT KeepFiles {
 public:
  KeepFiles();
  ~KeepFiles();
  KeepFiles(const KeepFiles&) = delete;
  KeepFiles& operator=(const KeepFiles&) = delete;

 private:
  const bool outer_;
};

/// Whether write_file writes through to what stands there, and replaces nothing. Throws IoError. Thread-safe.
EGOSGM_EXPORT bool is_stream(const std::filesystem::path& file);

/// Throws IoError where write_file could not write; changes nothing. Thread-safe.
EGOSGM_EXPORT void expect_writable(const std::filesystem::path& file);

/// Makes a folder with its parents. Throws IoError.
EGOSGM_EXPORT void make_folder(const std::filesystem::path& folder);

}  // namespace egosgm::vision
