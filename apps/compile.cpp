// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <filesystem>
#include <memory>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/device_arguments.h"
#include "apps/option_arguments.h"
#include "apps/output_folder.h"
#include "egosgm/programs.h"
#include "egosgm/vision/file_io.h"

namespace egosgm::app {
namespace {

struct CompileArguments {
  OptionArguments method;
  std::string device, out;
};

int compile(const CompileArguments& arguments) {
  const PipelineOptions options = arguments.method.options();
  Inputs inputs;
  inputs.add_file(arguments.method.config);
  const std::filesystem::path folder = new_folder("--out", arguments.out, inputs);
  const Device device = Device::select(arguments.device);
  const std::vector<ProgramFile> files = compile_programs(device, options);
  arguments.method.save(options);
  vision::make_folder(folder);
  for (const ProgramFile& file : files) vision::write_file(folder / file.name, file.bytes);  // the manifest last
  fmt::print("{} for {}: {}\n", counted(files.size() - 1, "program"), device.info().name, folder.string());
  return kOk;
}

}  // namespace

Command add_compile(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("compile", "Compile the kernels ahead, for machines without an OpenCL compiler");
  auto arguments = std::make_shared<CompileArguments>();
  command->add_option("--out", arguments->out, "new folder: program binaries, and manifest.json, which says of what")
      ->type_name("DIR")
      ->group("Output")
      ->required();
  arguments->method.add_to(*command);
  add_device(*command, arguments->device);
  return {command, [arguments] { return compile(*arguments); }};
}

}  // namespace egosgm::app
