// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "apps/cli_names.h"
#include "apps/frame_sink.h"
#include "apps/sequence_arguments.h"

namespace egosgm::app {

/// Exit codes of the program. docs/use/program.md, "Exit codes".
enum ExitCode : int { kOk = 0, kFailed = 1, kBadInput = 2, kInterrupted = 130 };

/// A subcommand and what it does once its arguments are parsed; `run` returns an ExitCode or throws.
struct Command {
  CLI::App* arguments = nullptr;
  std::function<int()> run;
};

/// What the Python package does for a run.
struct Package {
  /// Makes this process the package's, for `why`; empty in the package. Does not return.
  std::function<void(const std::string& why)> take_over;
  /// The frames of a bag that lie in `range`, of a run that writes to `out`.
  std::function<std::shared_ptr<vision::FrameSource>(const BagArguments& bag, const std::string& calib,
                                                     vision::FrameRange range, const std::string& out)>
      open_bag;
  /// The frames of two videos, or of one of both views (`right` is empty), that lie in `range`, of a run that writes to
  /// `out`.
  std::function<std::shared_ptr<vision::FrameSource>(const VideoArguments& videos, const std::string& calib,
                                                     vision::FrameRange range, const std::string& out)>
      open_videos;
  CalibrationReader read_calibration;
  /// A recording, unless `file` is empty, a viewer, and a page in the browser.
  std::function<std::shared_ptr<FrameSink>(const std::string& file, bool viewer, bool page)> take;
};

Command add_run(CLI::App& program, const Package& package);
Command add_eval(CLI::App& program);
Command add_devices(CLI::App& program);
Command add_compile(CLI::App& program);
Command add_synth(CLI::App& program);
Command add_odometry(CLI::App& program, const Package& package);
Command add_tune(CLI::App& program);

}  // namespace egosgm::app
