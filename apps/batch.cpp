// SPDX-License-Identifier: Apache-2.0
// Many sequences over several devices, in one process or in many that share the output folder.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <memory>
#include <sstream>

#include "apps/batch_list.h"
#include "apps/batch_report.h"
#include "apps/batch_run.h"
#include "apps/command.h"
#include "apps/counted.h"
#include "apps/device_arguments.h"
#include "apps/interrupt.h"
#include "apps/motion_source.h"
#include "apps/run_outputs.h"
#include "apps/shard.h"
#include "apps/standard_output.h"
#include "apps/suggestion.h"
#include "egosgm/error.h"

namespace egosgm::app {
namespace {

using Json = nlohmann::ordered_json;

/// The parts between commas, without the blanks around them.
std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> parts;
  std::istringstream stream(list + ',');
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(CLI::detail::trim_copy(part));
  return parts;
}

/// "all", or names as of Device::select between commas; NAME/each is every compute unit of NAME.
std::vector<Device> devices_of(const std::string& list) {
  if (list == "all" && !Device::list().empty()) return Device::list();
  const std::string each = "/each";
  std::vector<Device> devices;
  const std::vector<std::string> names = split(list);
  if (std::find(names.begin(), names.end(), "") != names.end()) {
    throw InvalidArgument("--devices \"" + list + "\": give all, or names between commas");
  }
  for (const std::string& name : names) {
    if (!name.ends_with(each)) {
      devices.push_back(Device::select(name));
      continue;
    }
    const Device whole = Device::select(name.substr(0, name.size() - each.size()));
    for (int unit = 0; unit < whole.info().compute_units; ++unit) devices.push_back(whole.compute_units(unit, unit));
  }
  return devices;
}

std::vector<Device> select_devices(const BatchArguments& arguments) {
  std::vector<Device> devices = devices_of(arguments.devices);
  for (std::size_t i = 0; i < devices.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (!devices[i].shares_units(devices[k])) continue;
      throw InvalidArgument(
          fmt::format("--devices {}: {} and {} are the same device or share compute units: name each one once",
                      arguments.devices, devices[k].info().name, devices[i].info().name));
    }
  }
  if (arguments.programs.empty()) return devices;
  for (Device& device : devices) device = device.with_programs(arguments.programs);
  return devices;
}

std::string figure(const Json& value, const char* unit, const char* none = "-") {
  return value.is_number() ? fmt::format("{:.3f} {}", value.get<double>(), unit) : none;
}

void print_timing(const Json& timing) {
  print_now(fmt::format("{} in {:.1f} s: {:.2f} frames/s, {:.2f} a compute unit; energy a frame: CPU {}, GPU {}\n",
                        counted(timing["frames"].get<std::size_t>(), "frame"), timing["wall_seconds"].get<double>(),
                        timing["frames_per_second"].get<double>(),
                        timing["frames_per_second_per_compute_unit"].get<double>(),
                        figure(timing["cpu_joules_per_frame"], "J", "not told"),
                        figure(timing["gpu_joules_per_frame"], "J", "not told")));
}

void print_report(const Json& report, const std::filesystem::path& file) {
  fmt::print("{}, {}", counted(report["sequences_done"].get<std::size_t>(), "sequence"),
             counted(report["frames"].get<std::size_t>(), "frame"));
  for (const char* kind : {"noc", "occ"}) {
    const Json& pooled = report["pooled"][kind];
    if (std::isnan(pooled["bad_or_missing"].get<double>())) continue;  // no truth
    fmt::print("; {}: bad or missing {}, interpolated {}", kind, figure(pooled["bad_or_missing"], "%"),
               figure(pooled["interpolated"], "%"));
  }
  fmt::print(": {}\n", file.string());
}

/// Of all sequences of the list, whoever ran them.
int report_all(const BatchArguments& arguments, const std::vector<BatchEntry>& entries, const BatchFolder& folder) {
  const Json report = folder.write_report(entries);
  if (!arguments.quiet) print_report(report, std::filesystem::path(arguments.out) / "batch.json");
  const auto failed = report["sequences_failed"].get<std::int64_t>();
  if (failed == 0) return kOk;
  for (const Json& sequence : report["sequences"]) {
    if (!sequence.contains("failed")) continue;
    say(fmt::format("egosgm: error: {} of {} sequences are not done, the first is {}: {}; run the batch again", failed,
                    entries.size(), sequence["name"].get<std::string>(), sequence["failed"].get<std::string>()));
    break;
  }
  return kFailed;
}

std::vector<BatchEntry> part_of(const std::vector<BatchEntry>& entries, const Shard& shard) {
  std::vector<BatchEntry> part;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (shard.contains(i)) part.push_back(entries[i]);
  }
  return part;
}

std::vector<BatchEntry> not_done(const std::vector<BatchEntry>& entries, const BatchFolder& folder) {
  std::vector<BatchEntry> left;
  std::copy_if(entries.begin(), entries.end(), std::back_inserter(left),
               [&](const BatchEntry& entry) { return folder.is_to_do(entry); });
  return left;
}

std::vector<BatchEntry> failed_of(const std::vector<BatchEntry>& entries, const BatchFolder& folder) {
  std::vector<BatchEntry> failed;
  std::copy_if(entries.begin(), entries.end(), std::back_inserter(failed),
               [&](const BatchEntry& entry) { return !folder.is_done(entry); });
  return failed;
}

/// Where a shard's own figures go.
std::filesystem::path timing_file(const BatchArguments& arguments, const Shard& shard) {
  const std::string part = shard.count > 1 ? fmt::format("-{}-of-{}", shard.index, shard.count) : "";
  return std::filesystem::path(arguments.out) / ("timing" + part + ".json");
}

int report_shard(const Shard& shard, const std::vector<BatchEntry>& failed) {
  if (failed.empty()) return kOk;
  say(fmt::format("egosgm: error: {} of shard {}/{} failed, the first is {}: see its failed.json",
                  counted(failed.size(), "sequence"), shard.index, shard.count, failed.front().name));
  return kFailed;
}

/// What is wrong with the input of a line names the line.
template <typename Look>
void naming_line(const BatchEntry& entry, Look&& look) {
  try {
    look();
  } catch (const MissingPath& error) {
    throw InvalidArgument(entry.place + ": " + error.what() + meant_path(error));
  } catch (const InvalidArgument& error) {
    throw InvalidArgument(entry.place + ": " + error.what());
  }
}

int batch(const BatchArguments& arguments) {
  const std::vector<BatchEntry> entries = read_batch_list(arguments.list);
  const PipelineOptions options = arguments.method.options();
  arguments.method.expect_saves(arguments.out);
  const Json settings = batch_settings(options, arguments.odometry, parse_write_list(arguments.write));
  BatchFolder folder(arguments.out, settings, arguments.overwrite && !arguments.merge);
  if (arguments.merge) return report_all(arguments, entries, folder);

  // All mistakes in the arguments now, before anything is written.
  const Shard shard = shard_of(arguments.shard, arguments.shards);
  const std::vector<BatchEntry> part = part_of(entries, shard);
  for (const BatchEntry& entry : part) parse_input(entry);
  expect_own_json(timing_file(arguments, shard));
  const std::vector<BatchEntry> left = not_done(part, folder);
  for (const BatchEntry& entry : left) {
    naming_line(entry, [&] {
      const SequenceJob job = job_of(arguments, options, folder, entry);
      if (!job.poses_file.empty()) vision::poses_of_frames(job.sequence, job.poses_file);
    });
  }
  const std::vector<Device> devices = select_devices(arguments);

  arguments.method.save(options);
  folder.begin(shard.count > 1);
  if (!left.empty()) {
    catch_interrupts();
    BatchRun batch(arguments, left, folder, options, devices);
    if (!batch()) return kInterrupted;
    const Json timing = batch.timing();
    write_own_json(timing_file(arguments, shard), timing);
    if (!arguments.quiet) print_timing(timing);
  }
  return shard.count == 1 ? report_all(arguments, entries, folder) : report_shard(shard, failed_of(part, folder));
}

}  // namespace

Command add_batch(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("batch", "Many sequences over several devices or machines, and one report");
  auto arguments = std::make_shared<BatchArguments>();
  command
      ->add_option("LIST", arguments->list,
                   "file with a line a sequence: NAME and the input as for run, for example\n"
                   "  scene-151 --kitti kitti2012/training --scene 000151 --frames 7:10\n"
                   "  drive-7 raw/drive_0007 --poses drive_0007.txt")
      ->type_name("")
      ->required();
  command
      ->add_option("--out", arguments->out,
                   "folder to write: NAME/ as by run, batch.json (all results, metrics pooled where there is truth), "
                   "timing.json; what is done there already is not done again")
      ->type_name("DIR")
      ->required();
  command
      ->add_option("--devices", arguments->devices,
                   "OpenCL devices that share the sequences: all, or names as for run --device between commas; "
                   "NAME/each: every compute unit of NAME [all]")
      ->type_name("LIST");
  command
      ->add_option(
          "--shard", arguments->shard,
          "only part K (from 0) of N; without, that of the task in a Slurm job array or Kubernetes Indexed Job")
      ->type_name("K/N");
  command->add_option("--shards", arguments->shards, "number of parts, where only JOB_COMPLETION_INDEX is set")
      ->type_name("N");
  command->add_flag("--merge", arguments->merge, "run nothing: make batch.json of what all shards have done");
  command->add_option("--write", arguments->write, kWriteListHelp)->type_name("LIST");
  command->add_flag("--overwrite", arguments->overwrite,
                    "do all again, and replace earlier runs in OUT/NAME: what their report.json says they wrote");
  command->add_flag("--quiet", arguments->quiet, "no progress, only errors");
  arguments->method.add_to(*command);
  add_programs(*command, arguments->programs);
  add_motion_bounds(*command, arguments->odometry, "Method");
  return {command, [arguments] { return batch(*arguments); }};
}

}  // namespace egosgm::app
