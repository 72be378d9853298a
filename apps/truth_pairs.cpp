// SPDX-License-Identifier: Apache-2.0
#include "apps/truth_pairs.h"

#include <fmt/core.h>

#include <CLI/App.hpp>

#include "apps/option_group.h"
#include "apps/run_folder.h"
#include "egosgm/error.h"
#include "vision/pair_with_truth.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

std::map<std::string, std::string> image_names_of_run(const fs::path& estimate) {
  std::map<std::string, std::string> names;
  const std::optional<vision::StereoSequence> run = frames_of_run(estimate);
  if (!run) return names;
  for (const vision::StereoFrame& frame : run->frames) {
    if (!frame.left.empty()) names[frame.name] = frame.left.stem().string();
  }
  return names;
}

}  // namespace

vision::EvaluationPairs find_truth_pairs(const fs::path& estimate, const fs::path& truth, const std::string& frames) {
  vision::PairingOptions options;
  if (!frames.empty()) options.frames = vision::parse_frame_range(frames);
  options.image_names = image_names_of_run(estimate);
  return vision::pair_with_truth(estimate, truth, options);
}

void ComparisonArguments::add_to(CLI::App& command, const std::string& estimate_help, const std::string& truth_help) {
  OptionGroup options(command);
  options.add("ESTIMATE", positional_[0], "", "what --estimate takes");
  options.add("TRUTH", positional_[1], "", "what --truth takes");
  options.add("--estimate", estimate, "FILE|DIR", estimate_help);
  options.add("--truth", truth, "FILE|DIR", truth_help);
  options.add("--frames", frames, "FIRST:LAST", "only these frame numbers, both ends included: 7:10, 7:, :10 or 7");
}

void ComparisonArguments::resolve() {
  for (const std::string& argument : positional_) {
    if (argument.empty()) continue;
    std::string& free = estimate.empty() ? estimate : truth;
    if (!free.empty()) {
      throw InvalidArgument(
          fmt::format("unexpected argument \"{}\": --estimate and --truth are given already", argument));
    }
    free = argument;
  }
  if (estimate.empty()) throw InvalidArgument("no estimate: give ESTIMATE TRUTH, or --estimate and --truth");
  if (truth.empty()) throw InvalidArgument("no truth: give ESTIMATE TRUTH, or --estimate and --truth");
}

}  // namespace egosgm::app
