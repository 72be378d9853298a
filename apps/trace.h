// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "egosgm/pipeline.h"

namespace egosgm::app {

/// Records the times of a run in Chrome's trace format (Perfetto and chrome://tracing open it): a row for each of
/// the device's queues, one for what the host does before a frame, one for what it does after. Not thread-safe.
class Trace {
 public:
  using Time = std::chrono::steady_clock::time_point;
  enum class Row { kPrepare = 1, kWrite, kUpload, kKernels, kDownload };

  explicit Trace(std::filesystem::path file);

  void add_host(const std::string& name, const std::string& frame, Row row, Time start, double ms);
  void add_device(const std::vector<DeviceCommand>& commands, const std::string& frame);

  /// Whether the driver told when commands ran: one that does not answers some nanoseconds for all of them.
  bool has_device_times() const { return has_device_times_; }

  /// Throws IoError.
  void write() const;

 private:
  double us_since_start(std::int64_t steady_clock_ns) const;

  const std::filesystem::path file_;
  const Time start_ = std::chrono::steady_clock::now();
  nlohmann::ordered_json events_;
  bool has_device_times_ = true;
};

}  // namespace egosgm::app
