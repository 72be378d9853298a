// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "host/ocl/program_folder.h"

namespace egosgm::ocl {

/// Built programs in a folder, for drivers that keep none themselves. Nothing that is wrong with the folder or with one
/// of its files is an error: what cannot be taken from there is built. Constant, so thread-safe; processes may share
/// the folder.
class ProgramCache {
 public:
  static constexpr std::uintmax_t kMaxBytes = std::uintmax_t{256} << 20;

  /// `wanted`: a folder, for every driver; "off": none; empty: as the environment variable EGOSGM_CACHE says. Without
  /// either, a driver that keeps no programs itself gets $XDG_CACHE_HOME/egosgm or ~/.cache/egosgm.
  static std::optional<ProgramCache> of(const cl::Device& device, const std::string& wanted = {});

  /// The cache drops the files that were used least lately where all have more than `max_bytes`.
  ProgramCache(std::filesystem::path folder, const cl::Device& device, std::uintmax_t max_bytes = kMaxBytes);

  /// The program of `source`, built. Null: the folder has none that this driver takes.
  cl::Program built(const cl::Context& context, const cl::Device& device, const ProgramSource& source) const;
  /// Keeps what `source` was built to.
  void keep(const ProgramSource& source, const cl::Program& program) const;
  /// The file that keeps the program of `source`.
  std::filesystem::path file_of(const ProgramSource& source) const;

 private:
  void make_room() const;

  std::filesystem::path folder_;
  std::string identity_;  // all but the source that a binary rests on
  std::uintmax_t max_bytes_;
};

}  // namespace egosgm::ocl
