// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <memory>
#include <sstream>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/device_arguments.h"
#include "apps/interrupt.h"
#include "apps/option_arguments.h"
#include "apps/option_group.h"
#include "apps/output_folder.h"
#include "apps/standard_output.h"
#include "egosgm/error.h"
#include "egosgm/programs.h"
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

struct CompileArguments {
  OptionArguments method;
  std::string device, out, clang = "clang", translator = "llvm-spirv";
  bool spirv = false;
};

/// Ends with an error where `command` does, which says itself what is wrong, or where an interrupt came meanwhile.
void expect_success(const std::vector<std::string>& command) {
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  pid_t process = 0;
  int status = 0;
  if (posix_spawnp(&process, words[0], nullptr, nullptr, words.data(), environ) != 0) {
    throw InvalidArgument("compile --il: " + command.front() +
                          " cannot be started: install it, or name it by --clang or --llvm-spirv");
  }
  while (waitpid(process, &status, 0) < 0 && errno == EINTR) {
  }
  if (status != 0 || interrupted())
    throw InvalidArgument("compile --il: " + command.front() + " failed: choose another version of it");
}

/// A folder that goes with it.
struct ScratchFolder {
  std::filesystem::path path;

  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "egosgm-il-XXXXXX").string();
    if (!mkdtemp(name.data())) throw IoError(name + ": " + std::strerror(errno));
    path = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
};

/// The SPIR-V of one program. Nothing is optimised here: that is the device's compiler's part, which knows its width.
std::string module_of(const ProgramText& program, const CompileArguments& arguments, const std::filesystem::path& in) {
  const std::string source = in / "program.cl", bitcode = in / "program.bc", module = in / "program.spv";
  vision::write_file(source, program.text);
  std::vector<std::string> compile{arguments.clang,
                                   "-x",
                                   "cl",
                                   "-cl-std=CL1.2",
                                   "-target",
                                   "spir64-unknown-unknown",
                                   "-fgnu89-inline",
                                   "-Xclang",
                                   "-finclude-default-header",
                                   "-cl-kernel-arg-info",
                                   "-O2",
                                   "-Xclang",
                                   "-disable-llvm-passes",
                                   "-Werror",
                                   "-emit-llvm",
                                   "-c"};
  std::istringstream defines(program.options);
  for (std::string define; defines >> define;) compile.push_back(define);
  compile.insert(compile.end(), {source, "-o", bitcode});
  expect_success(compile);
  expect_success({arguments.translator, "--spirv-max-version=1.0", bitcode, "-o", module});
  return vision::read_file(module, std::size_t{64} << 20);
}

std::vector<ProgramFile> compile_to_spirv(const Device& device, const PipelineOptions& options,
                                          const CompileArguments& arguments) {
  const std::vector<ProgramText> programs = list_programs(device, options);
  const ScratchFolder scratch;
  std::vector<std::string> modules;
  for (const ProgramText& program : programs) modules.push_back(module_of(program, arguments, scratch.path));
  return spirv_programs(programs, modules);
}

int compile(const CompileArguments& arguments) {
  catch_interrupts();
  const PipelineOptions options = arguments.method.options();
  arguments.method.expect_saves(arguments.out);
  const std::filesystem::path folder = new_folder("--out", arguments.out);
  const Device device = Device::select(arguments.device);
  const std::vector<ProgramFile> files =
      arguments.spirv ? compile_to_spirv(device, options, arguments) : compile_programs(device, options);
  if (interrupted()) {
    say("egosgm: interrupted: nothing is written");
    return kInterrupted;
  }
  const vision::KeepFiles others;
  arguments.method.save(options);
  vision::make_folder(folder);
  for (const ProgramFile& file : files) vision::write_file(folder / file.name, file.bytes);  // the manifest last
  const std::string whose = arguments.spirv
                                ? std::string("every ") + to_string(device.info().type) + " that takes SPIR-V"
                                : device.info().name;
  fmt::print("{} for {}: {}\n", counted(files.size() - 1, "program"), whose, folder.string());
  return kOk;
}

}  // namespace

Command add_compile(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("compile", "Compile the kernels ahead, for machines without an OpenCL compiler");
  auto arguments = std::make_shared<CompileArguments>();
  OptionGroup output(*command, "Output");
  output.add("--out", arguments->out, "DIR", "new folder: program binaries, and manifest.json, which says of what")
      ->required();
  output.add_flag("--il", arguments->spirv,
                  "SPIR-V in place of binaries: for every device of the type that takes it, whatever its driver. Needs "
                  "clang and llvm-spirv");
  output.add("--clang", arguments->clang, "NAME", "the compiler for --il [clang]")->needs("--il");
  output.add("--llvm-spirv", arguments->translator, "NAME", "the translator for --il, of clang's version [llvm-spirv]")
      ->needs("--il");
  arguments->method.add_to(*command);
  add_device_option(*command, "--device", arguments->device);
  return {command, [arguments] { return compile(*arguments); }};
}

}  // namespace egosgm::app
