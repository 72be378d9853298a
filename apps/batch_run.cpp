// SPDX-License-Identifier: Apache-2.0
#include "apps/batch_run.h"

#include <fmt/core.h>

#include <optional>
#include <thread>
#include <utility>

#include "apps/counted.h"
#include "apps/doubt.h"
#include "apps/interrupt.h"
#include "apps/motion_source.h"
#include "apps/output_folder.h"
#include "apps/run_outputs.h"
#include "apps/standard_output.h"
#include "egosgm/error.h"

namespace egosgm::app {
namespace {

using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

}  // namespace

SequenceJob job_of(const BatchArguments& arguments, const PipelineOptions& options, const BatchFolder& folder,
                   const BatchEntry& entry) {
  SequenceJob job;
  const BatchInput input = parse_input(entry);
  job.sequence = input.sequence.open();
  job.input = input.sequence.text();
  job.options = options;
  job.poses_file = input.poses_file;
  job.odometry = arguments.odometry;
  job.kinds = parse_write_list(arguments.write);
  Inputs inputs(input.sequence, job.sequence);
  for (const std::string& file : {arguments.list, input.poses_file, arguments.method.config}) inputs.add_file(file);
  inputs.add_folder(arguments.programs);
  inputs.expect_apart(arguments.out);
  job.out = OutputFolder(folder.folder_of(entry).string(), inputs, folder.treatment_of(entry),
                         output_files(job.kinds, job.sequence, job.options));
  job.batch_input = entry.arguments;
  job.quiet = true;
  return job;
}

BatchRun::BatchRun(const BatchArguments& arguments, std::vector<BatchEntry> entries, const BatchFolder& folder,
                   const PipelineOptions& options, std::vector<Device> devices)
    : arguments_(arguments),
      entries_(std::move(entries)),
      folder_(folder),
      options_(options),
      devices_(std::move(devices)),
      work_(devices_.size()),
      queue_(static_cast<int>(entries_.size()), static_cast<int>(devices_.size())) {}

bool BatchRun::operator()() {
  std::vector<std::thread> workers;
  for (std::size_t i = 0; i < devices_.size(); ++i) {
    workers.emplace_back([this, i] { work(static_cast<int>(i)); });
  }
  for (std::thread& worker : workers) worker.join();
  if (stopped_by_) std::rethrow_exception(stopped_by_);
  return !interrupted();
}

Json BatchRun::timing() {
  energy_.sample();
  const double wall = seconds_since(start_);
  Json json{{"wall_seconds", wall}, {"frames", 0}, {"devices", Json::array()}};
  int frames = 0, units = 0;
  for (std::size_t i = 0; i < devices_.size(); ++i) {
    const DeviceInfo& info = devices_[i].info();
    frames += work_[i].frames;
    units += info.compute_units;
    json["devices"].push_back({{"name", info.name},
                               {"driver", info.driver},
                               {"compute_units", info.compute_units},
                               {"sequences", work_[i].sequences},
                               {"frames", work_[i].frames},
                               {"seconds", work_[i].seconds},
                               {"retired", queue_.is_retired(static_cast<int>(i))}});
  }
  json["frames"] = frames;
  json["frames_per_second"] = frames / wall;
  json["frames_per_second_per_compute_unit"] = frames / wall / units;
  add_energy(json, frames);
  return json;
}

void BatchRun::add_energy(Json& json, int frames) const {
  const auto add = [&](const std::string& name, std::optional<double> joules) {
    json[name + "_joules"] = joules ? Json(*joules) : Json();
    json[name + "_joules_per_frame"] = joules && frames > 0 ? Json(*joules / frames) : Json();
  };
  add("cpu", energy_.cpu_joules());
  add("gpu", energy_.gpu_joules());
}

void BatchRun::work(int device) {
  try {
    while (const auto job = queue_.next(device)) run(*job, device);
  } catch (...) {  // the output folder cannot be written, or is another's: no sequence can be completed
    const std::lock_guard lock(mutex_);
    stopped_by_ = std::current_exception();
    queue_.stop();
  }
}

void BatchRun::run(int number, int device) {
  const BatchEntry& entry = entries_[number];
  const auto start = Clock::now();
  try {
    folder_.begin(entry);
    const SequenceJob job = job_of(arguments_, options_, folder_, entry);
    if (run_sequence(job, devices_[device])) {
      const Json done = folder_.finish(entry, job);
      finish(number, device, done, job.input, seconds_since(start));
    } else {
      queue_.stop();
    }
  } catch (const DeviceError& error) {
    if (interrupted()) return queue_.stop();  // by which a driver's compiler fails
    hand_over(number, device, error.what());
  } catch (const IoError&) {
    throw;
  } catch (const FolderInUse&) {  // what becomes of the sequence is the other's to say
    throw;
  } catch (const std::exception& error) {
    queue_.failed();
    fail(entry, error.what());
  }
}

void BatchRun::finish(int number, int device, const Json& done, const std::string& input, double seconds) {
  const int frames = done.at("frames");
  const std::string doubt = done.value("doubt", "");
  queue_.succeeded(number);
  energy_.sample();
  const std::lock_guard lock(mutex_);
  DeviceWork& work = work_[device];
  ++work.sequences;
  work.frames += frames;
  work.seconds += seconds;
  ++done_;
  tell(fmt::format("{}: {}, {:.1f} frames/s, {}{}", entries_[number].name, counted(frames, "frame"), frames / seconds,
                   devices_[device].info().name, doubt.empty() ? "" : "; " + advice_of(doubt, input)));
}

void BatchRun::hand_over(int number, int device, const std::string& reason) {
  const BatchEntry& entry = entries_[number];
  const std::string where = devices_[device].info().name + ": " + reason;
  // Before another device may begin with it.
  folder_.fail(entry, where);
  if (queue_.hand_over(number, device)) {
    const std::lock_guard lock(mutex_);
    tell(fmt::format("{}: handed to another device: {}", entry.name, where));
  } else {
    tell_failed(entry, where);
  }
}

void BatchRun::fail(const BatchEntry& entry, const std::string& reason) {
  folder_.fail(entry, reason);
  tell_failed(entry, reason);
}

void BatchRun::tell_failed(const BatchEntry& entry, const std::string& reason) {
  const std::lock_guard lock(mutex_);
  ++done_;
  tell(fmt::format("{}: failed: {}", entry.name, reason));
}

void BatchRun::tell(const std::string& line) const {
  if (arguments_.quiet) return;
  print_now(fmt::format("[{}/{}] {}\n", done_, entries_.size(), line));
}

}  // namespace egosgm::app
