// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "egosgm/vision/dataset.h"

namespace egosgm::app {

/// The arguments that say which stereo sequence to read.
struct SequenceArguments {
  std::string kitti, scene, odometry, folder, left, right, calib, frames;

  void add_to(CLI::App& command);
  /// Adds a positional DATASET in place of --dataset.
  void add_to_with_positional(CLI::App& command);
  /// Throws InvalidArgument unless exactly one sequence was named, and as the openers do.
  vision::StereoSequence open() const;
  /// What was given, as a shell takes it for any command that reads a sequence.
  std::string text() const;

 private:
  void add_sources(CLI::App& command);
};

}  // namespace egosgm::app
