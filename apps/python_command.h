// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace egosgm::app {

/// A command that the Python package has; python/egosgm/program.py names its module.
struct PythonCommand {
  const char* name;
  const char* help;
};

inline constexpr PythonCommand kPythonCommands[] = {
    {"eval-video", "Compare disparity maps of a video over time, and with another method's (the Python package)"},
    {"eval-poses", "Compare poses with the true ones, as KITTI's odometry kit does (the Python package)"},
};

bool is_python_command(const std::string& name);

/// Becomes `python3 -m egosgm ARGUMENTS`, with the package that was built or installed beside this program. Throws
/// InvalidArgument where there is none, and IoError where Python does not start.
[[noreturn]] void start_python_command(char** arguments);

}  // namespace egosgm::app
