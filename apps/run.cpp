// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <CLI/App.hpp>
#include <filesystem>
#include <memory>
#include <optional>

#include "apps/command.h"
#include "apps/interrupt.h"
#include "apps/run_arguments.h"
#include "apps/run_sequence.h"
#include "apps/standard_output.h"
#include "apps/tuning_file.h"
#include "egosgm/error.h"

namespace egosgm::app {
namespace {

/// The device of --fallback. Throws InvalidArgument where what the run makes cannot be made twice.
std::optional<Device> fallback_of(const RunArguments& arguments) {
  if (arguments.fallback.empty()) return std::nullopt;
  if (!arguments.has_folder() || arguments.rerun || arguments.show) {
    throw InvalidArgument(
        "--fallback: frames are matched again, which a viewer or a recording would show twice: give a folder as --out");
  }
  return tuned_by_argument(Device::select(arguments.fallback).with_cache(arguments.cache), arguments.tuning);
}

/// The rest of a job whose device failed: its written files stay.
SequenceJob rest_of(RunArguments arguments, const Package& package, const LostDevice& lost) {
  arguments.resume = true;
  for (std::string* file : {&arguments.trace, &arguments.method.save_config}) {
    if (std::filesystem::exists(*file)) file->clear();
  }
  SequenceJob job = arguments.job(package);
  job.lost = lost;
  return job;
}

int run(const RunArguments& arguments, const Package& package) {
  catch_interrupts();  // from here on: the input may be waited for, and parts of a bag be unpacked meanwhile
  const SequenceJob job = arguments.job(package);
  Device device = Device::select(arguments.device).with_cache(arguments.cache);
  if (arguments.programs.empty() || !arguments.tuning.empty()) device = tuned_by_argument(device, arguments.tuning);
  if (!arguments.programs.empty()) device = device.with_programs(arguments.programs);
  const std::optional<Device> fallback = fallback_of(arguments);
  std::optional<LostDevice> lost;
  try {
    return run_sequence(job, device) ? kOk : kInterrupted;
  } catch (const DeviceError& error) {
    if (!fallback || interrupted()) throw;
    lost = {device.info(), error.what()};
  }
  say(fmt::format("egosgm: {} failed ({}): {} goes on", lost->device.name, lost->why, fallback->info().name));
  return run_sequence(rest_of(arguments, package, *lost), *fallback) ? kOk : kInterrupted;
}

}  // namespace

Command add_run(CLI::App& program, const Package& package) {
  CLI::App* command = program.add_subcommand(
      "run", "Disparity and variance for every frame of a stereo sequence: a folder, two pictures, a bag, or videos");
  auto arguments = std::make_shared<RunArguments>();
  arguments->add_to(*command);
  return {command, [arguments, package] { return run(*arguments, package); }};
}

}  // namespace egosgm::app
