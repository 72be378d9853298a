// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "apps/command.h"

namespace egosgm::app {

/// The program: does what the arguments (the first one is the program's name) ask for, and returns an ExitCode. What is
/// wrong stands on the standard error. `package`: the Python package, where it is this process; null: what is its work
/// makes this process the package's.
int run_program(int argc, const char* const* argv, const Package* package);

}  // namespace egosgm::app
