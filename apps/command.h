// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace egosgm::app {

/// What the program returns to the shell. docs/program.md, "Exit codes".
enum ExitCode : int { kOk = 0, kFailed = 1, kBadInput = 2, kInterrupted = 130 };

/// A subcommand and what it does once its arguments are parsed; `run` returns an ExitCode or throws.
struct Command {
  CLI::App* arguments = nullptr;
  std::function<int()> run;
};

Command add_run(CLI::App& program);
Command add_eval(CLI::App& program);
Command add_devices(CLI::App& program);
Command add_compile(CLI::App& program);
Command add_synth(CLI::App& program);
Command add_odometry(CLI::App& program);
Command add_tune(CLI::App& program);

}  // namespace egosgm::app
