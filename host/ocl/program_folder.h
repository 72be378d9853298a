// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "egosgm/programs.h"
#include "host/ocl/opencl.h"

namespace egosgm::ocl {

/// The source of a program: its kernel file, the text that the compiler saw, and its options.
struct ProgramSource {
  std::string kernel_file, text, options;
  std::string device_options;  // those of `options` that are no defines
};

/// 16 hexadecimal digits (FNV-1a) that tell versions of a text apart, and whole files from broken ones. No protection
/// from intent.
std::string hash_of(std::string_view bytes);

/// The source without the parts that only some devices of a type get.
ProgramText portable(const ProgramSource& source);

/// Programs compiled ahead for one device, or to SPIR-V for all that take it. Constant, so thread-safe.
class ProgramFolder {
 public:
  /// Reads the manifest. Throws InvalidArgument, naming file, values and remedy, where it cannot be read or was made
  /// for another device, platform or driver than `device` has, or holds SPIR-V that `device` does not take.
  ProgramFolder(const std::filesystem::path& folder, const cl::Device& device);

  /// The binary of `source`. Throws InvalidArgument where the folder has none, where it was compiled from another text
  /// than this library's, or where its file is not the one that the manifest speaks of.
  std::vector<unsigned char> binary(const ProgramSource& source) const;
  /// The program of `source`, to be built. Throws as `binary`.
  cl::Program program(const cl::Context& context, const cl::Device& device, const ProgramSource& source) const;
  /// The options to build it with.
  std::string options(const ProgramSource& source) const { return is_spirv_ ? source.device_options : source.options; }

 private:
  struct Entry {
    std::string file, source_hash, binary_hash;
  };
  std::filesystem::path folder_;
  bool is_spirv_ = false;
  std::map<std::pair<std::string, std::string>, Entry> entries_;  // by kernel file and options
};

/// The files of such a folder. REQUIRES: programs built for `device` alone.
std::vector<ProgramFile> files_of(const cl::Device& device,
                                  const std::vector<std::pair<ProgramSource, cl::Program>>& programs);

}  // namespace egosgm::ocl
