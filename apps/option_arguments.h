// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "apps/cli_names.h"
#include "egosgm/options.h"

namespace egosgm::app {

/// The arguments that choose the pipeline's options. They apply in this order, the last one wins: --preset, --config,
/// --set, and those with a name of their own (--temporal, --disparities, ...).
struct OptionArguments {
  std::string preset, config, save_config;
  std::vector<std::string> settings;
  std::string temporal, paths, disparities, min_disparity;

  void add_to(CLI::App& command);
  /// Reads --config. Throws InvalidArgument, naming the option (and the file).
  PipelineOptions options() const;
  /// Throws InvalidArgument where --save-config names a file that is there or lies in `out`, and IoError where it
  /// cannot be written.
  void expect_saves(const std::string& out) const;
  /// Writes --save-config. Throws IoError.
  void save(const PipelineOptions& options) const;
};

/// The text that --save-config writes.
std::string config_text(const PipelineOptions& options);

}  // namespace egosgm::app
