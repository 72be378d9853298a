// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "egosgm/programs.h"
#include "host/ocl/opencl.h"

namespace egosgm::ocl {

/// What a program is made of: its kernel file, the text that the compiler saw, and the options that it was given.
struct ProgramSource {
  std::string kernel_file, text, options;
};

/// Programs compiled ahead for one device. Constant, so thread-safe.
class ProgramFolder {
 public:
  /// Reads the manifest. Throws InvalidArgument, naming file, values and remedy, where it cannot be read or was made
  /// for another device, platform or driver than `device` has.
  ProgramFolder(const std::filesystem::path& folder, const cl::Device& device);

  /// The binary of `source`. Throws InvalidArgument where the folder has none, where it was compiled from another text
  /// than this library's, or where its file is not the one that the manifest speaks of.
  std::vector<unsigned char> binary(const ProgramSource& source) const;

 private:
  struct Entry {
    std::string file, source_hash, binary_hash;
  };
  std::filesystem::path folder_;
  std::map<std::pair<std::string, std::string>, Entry> entries_;  // by kernel file and options
};

/// The files of such a folder. REQUIRES: programs built for `device` alone.
std::vector<ProgramFile> files_of(const cl::Device& device,
                                  const std::vector<std::pair<ProgramSource, cl::Program>>& programs);

}  // namespace egosgm::ocl
