// SPDX-License-Identifier: Apache-2.0
#include "apps/python_tools.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>
#include <vector>

#include "egosgm/error.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

/// Run with the package's folder (empty: none is known) and the command's arguments. The current folder is not searched
/// for modules. run_tool only runs tools in Python, so that it never comes back to this program.
constexpr const char* kLaunch = R"python(import signal, sys
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # an interrupt while modules load is none of their errors; run_tool takes it
folder = sys.argv.pop(1)
sys.path[:] = [folder] * bool(folder) + [entry for entry in sys.path if entry]
try:
    from egosgm.program import run_tool
except ImportError as error:
    sys.exit(f"egosgm: error: {sys.argv[1]}: needs the Python package egosgm, which {sys.executable} does not load: {error}; "
             "pip install the wheel, or build the package with the program (docs/use/python.md)")
sys.exit(run_tool(sys.argv[1:]))
)python";

struct Package {
  std::string interpreter, folder;
};

Package package_beside_program() {
#ifdef EGOSGM_PACKAGE_PYTHON
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none).parent_path();
  for (const char* from_program : {EGOSGM_PACKAGE_BUILT, EGOSGM_PACKAGE_INSTALLED}) {
    const fs::path folder = (program / from_program).lexically_normal();
    if (fs::exists(folder / "egosgm/program.py", none)) return {EGOSGM_PACKAGE_PYTHON, folder.string()};
  }
#endif
  return {"python3", ""};
}

}  // namespace

std::map<std::string, std::string> python_tools() {
  std::map<std::string, std::string> tools;
  const nlohmann::json listed = nlohmann::json::parse(embedded_files().at("tools.json"));
  for (const auto& [name, tool] : listed.items()) tools[name] = tool.at("help").get<std::string>();
  return tools;
}

bool is_for_python(int argc, const char* const* argv) {
  if (argc < 2) return false;
  if (python_tools().contains(argv[1])) return true;
  const auto is_of_package = [](std::string_view word) {
    return word == "--rerun" || word.substr(0, word.find('=')) == "--bag" || word.ends_with(".mcap") ||
           word.ends_with(".rrd");
  };
  return std::string_view(argv[1]) == "run" && std::any_of(argv + 2, argv + argc, is_of_package);
}

void become_python(int argc, const char* const* argv) {
  const Package package = package_beside_program();
  std::vector<const char*> words{package.interpreter.c_str(), "-c", kLaunch, package.folder.c_str()};
  words.insert(words.end(), argv + 1, argv + argc);
  words.push_back(nullptr);
  execvp(words[0], const_cast<char* const*>(words.data()));
  throw IoError(std::string(argv[1]) + ": needs Python and its package egosgm, and " + package.interpreter +
                " cannot be started: " + std::generic_category().message(errno) +
                "; install Python, then pip install the wheel (docs/use/python.md)");
}

}  // namespace egosgm::app
