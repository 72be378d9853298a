// SPDX-License-Identifier: Apache-2.0
#include "apps/python_tools.h"

#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <system_error>
#include <vector>

#include "egosgm/error.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

/// Run with the package's folder (empty: none is known), the reason, and the command's arguments. The current folder is
/// not searched for modules. run_tool only runs tools in Python, so that it never comes back to this program.
constexpr const char* kLaunch = R"python(import signal, sys
if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # an interrupt while modules load is none of their errors; run_tool takes it
folder, why = sys.argv.pop(1), sys.argv.pop(1)
sys.path[:] = [folder] * bool(folder) + [entry for entry in sys.path if entry]
try:
    from egosgm.program import run_tool
except ImportError as error:
    sys.exit(f"egosgm: error: {sys.argv[1]}: {why}needs the Python package egosgm, which {sys.executable} does not load: {error}; "
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

bool is_for_python(int argc, const char* const* argv) { return argc >= 2 && python_tools().contains(argv[1]); }

void become_python(int argc, const char* const* argv, const std::string& why) {
  const std::string reason = why.empty() ? "" : why + ": ";
  const Package package = package_beside_program();
  std::vector<const char*> words{package.interpreter.c_str(), "-c", kLaunch, package.folder.c_str(), reason.c_str()};
  words.insert(words.end(), argv + 1, argv + argc);
  words.push_back(nullptr);
  execvp(words[0], const_cast<char* const*>(words.data()));
  throw IoError(std::string(argv[1]) + ": " + reason + "needs Python and its package egosgm, and " +
                package.interpreter + " cannot be started: " + std::generic_category().message(errno) +
                "; install Python, then pip install the wheel (docs/use/python.md)");
}

}  // namespace egosgm::app
