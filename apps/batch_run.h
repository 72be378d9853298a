// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <exception>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/batch_list.h"
#include "apps/batch_queue.h"
#include "apps/batch_report.h"
#include "apps/energy_meter.h"
#include "apps/option_arguments.h"
#include "apps/run.h"
#include "egosgm/device.h"
#include "egosgm/odometry.h"

namespace egosgm::app {

struct BatchArguments {
  std::string list, out, devices = "all", programs, write, shard, shards;
  OptionArguments method;
  StereoOdometryOptions odometry;
  bool merge = false, quiet = false, overwrite = false;
};

/// Opens the input, and looks whether its folder is free. Throws InvalidArgument.
SequenceJob job_of(const BatchArguments& arguments, const PipelineOptions& options, const BatchFolder& folder,
                   const BatchEntry& entry);

/// Runs sequences on devices, each in a thread of its own that takes the next one when it is done.
class BatchRun {
 public:
  BatchRun(const BatchArguments& arguments, std::vector<BatchEntry> entries, const BatchFolder& folder,
           const PipelineOptions& options, std::vector<Device> devices);

  /// Returns whether it was not interrupted.
  bool operator()();

  /// What each device did, for OUT/timing.json.
  nlohmann::ordered_json timing();

 private:
  using Clock = std::chrono::steady_clock;
  struct DeviceWork {
    int sequences = 0, frames = 0;
    double seconds = 0;
  };

  void add_energy(nlohmann::ordered_json& json, int frames) const;
  void work(int device);  // a device's thread
  void run(int number, int device);
  void finish(int number, int device, const nlohmann::ordered_json& done, const std::string& input, double seconds);
  void hand_over(int number, int device, const std::string& reason);
  void fail(const BatchEntry& entry, const std::string& reason);
  void tell_failed(const BatchEntry& entry, const std::string& reason);
  void tell(const std::string& line) const;

  const BatchArguments& arguments_;
  const std::vector<BatchEntry> entries_;
  const BatchFolder& folder_;
  const PipelineOptions& options_;
  const std::vector<Device> devices_;
  const Clock::time_point start_ = Clock::now();

  std::mutex mutex_;
  std::vector<DeviceWork> work_;
  std::size_t done_ = 0;
  std::exception_ptr stopped_by_;
  EnergyMeter energy_;
  BatchQueue queue_;
};

}  // namespace egosgm::app
