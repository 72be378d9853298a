// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "apps/cli_names.h"
#include "egosgm/vision/evaluation.h"
#include "vision/pair_with_truth.h"

namespace egosgm::app {

/// vision::pair_with_truth with the names of the images, where `estimate` is or lies in a folder that `egosgm run`
/// wrote (its report.json tells them); `frames` as for --frames, empty: all. Throws InvalidArgument.
vision::EvaluationPairs find_truth_pairs(const std::filesystem::path& estimate, const std::filesystem::path& truth,
                                         const std::string& frames = {});

/// The files to compare: `COMMAND ESTIMATE TRUTH`, or --estimate and --truth, or one of each kind; and --frames.
struct ComparisonArguments {
  std::string estimate, truth, frames;

  /// `estimate_help` and `truth_help` say what --estimate and --truth take.
  void add_to(CLI::App& command, const std::string& estimate_help, const std::string& truth_help);
  /// Fills `estimate` and `truth` from the positional arguments. Throws InvalidArgument unless both are given once.
  void resolve();

 private:
  std::string positional_[2];
};

}  // namespace egosgm::app
