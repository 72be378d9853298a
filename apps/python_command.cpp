// SPDX-License-Identifier: Apache-2.0
#include "apps/python_command.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "egosgm/error.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

/// The folder that holds the package, or nothing.
fs::path package_folder() {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path above = program.parent_path().parent_path();
  // A build, an installation, and a wheel, whose program lies in the package.
  for (const fs::path& folder : {above / "python", above / "lib/python3/dist-packages", above.parent_path()}) {
    if (fs::exists(folder / "egosgm" / "__main__.py", error)) return folder;
  }
  return {};
}

}  // namespace

bool is_python_command(const std::string& name) {
  return std::any_of(std::begin(kPythonCommands), std::end(kPythonCommands),
                     [&](const PythonCommand& command) { return name == command.name; });
}

void start_python_command(char** arguments) {
  const fs::path folder = package_folder();
  if (folder.empty()) {
    throw InvalidArgument(
        fmt::format("{}: the Python package has this command: pip install the wheel, or build with -DEGOSGM_PYTHON=ON "
                    "(docs/python.md)",
                    arguments[0]));
  }
  const char* known = std::getenv("PYTHONPATH");
  setenv("PYTHONPATH", (folder.string() + (known && *known ? ":" + std::string(known) : "")).c_str(), 1);
  std::string python = EGOSGM_PYTHON_PROGRAM, option = "-m", package = "egosgm";
  std::vector<char*> words{python.data(), option.data(), package.data()};
  while (*arguments) words.push_back(*arguments++);
  words.push_back(nullptr);
  execvp(python.c_str(), words.data());
  throw IoError(fmt::format("{}: Python does not start: {}", python, std::strerror(errno)));
}

}  // namespace egosgm::app
