// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <string_view>

// Some commands of `egosgm` are written in Python: python/egosgm/tools.json lists them for both languages.

namespace egosgm::app {

/// The files that the program holds, by name.
const std::map<std::string_view, std::string_view>& embedded_files();

/// Commands that the Python package has, each with its line of help.
std::map<std::string, std::string> python_tools();

/// Whether the Python package has the command.
bool is_for_python(int argc, const char* const* argv);

/// Lets Python, with the package that was built or installed beside the program, or else with the one that it finds,
/// take the place of this process. Throws IoError where there is no Python. Python itself says where the package is
/// missing, and exits with 1. `why`: what of the arguments needs the package; empty: the command.
[[noreturn]] void become_python(int argc, const char* const* argv, const std::string& why = {});

}  // namespace egosgm::app
