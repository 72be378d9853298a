// SPDX-License-Identifier: Apache-2.0
#include "apps/trace.h"

#include <algorithm>
#include <utility>

#include "apps/output_folder.h"
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

using Json = nlohmann::ordered_json;

std::int64_t ns_of(Trace::Time time) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(time.time_since_epoch()).count();
}

Trace::Row row_of(DeviceQueue queue) {
  return queue == DeviceQueue::kUpload     ? Trace::Row::kUpload
         : queue == DeviceQueue::kDownload ? Trace::Row::kDownload
                                           : Trace::Row::kKernels;
}

Json named(const char* what, Trace::Row row, const char* name) {
  return {{"name", what}, {"ph", "M"}, {"pid", 1}, {"tid", static_cast<int>(row)}, {"args", {{"name", name}}}};
}

}  // namespace

Trace::Trace(std::filesystem::path file) : file_(std::move(file)), events_(Json::array()) {
  const std::pair<Row, const char*> rows[] = {{Row::kPrepare, "host: read, odometry"},
                                              {Row::kWrite, "host: write"},
                                              {Row::kUpload, "device: upload"},
                                              {Row::kKernels, "device: kernels"},
                                              {Row::kDownload, "device: download"}};
  events_.push_back(named("process_name", Row::kPrepare, "egosgm run"));
  for (const auto& [row, name] : rows) events_.push_back(named("thread_name", row, name));
}

double Trace::us_since_start(std::int64_t steady_clock_ns) const {
  return static_cast<double>(steady_clock_ns - ns_of(start_)) * 1e-3;
}

void Trace::add_host(const std::string& name, const std::string& frame, Row row, Time start, double ms) {
  events_.push_back({{"name", name},
                     {"cat", "host"},
                     {"ph", "X"},
                     {"ts", us_since_start(ns_of(start))},
                     {"dur", 1e3 * ms},
                     {"pid", 1},
                     {"tid", static_cast<int>(row)},
                     {"args", {{"frame", frame}}}});
}

void Trace::add_device(const std::vector<DeviceCommand>& commands, const std::string& frame) {
  has_device_times_ = std::any_of(commands.begin(), commands.end(), [](const DeviceCommand& command) {
    return command.ended_ns - command.queued_ns >= 10;
  });
  for (const DeviceCommand& command : commands) {
    events_.push_back({{"name", command.name},
                       {"cat", command.stage},
                       {"ph", "X"},
                       {"ts", us_since_start(command.started_ns)},
                       {"dur", static_cast<double>(command.ended_ns - command.started_ns) * 1e-3},
                       {"pid", 1},
                       {"tid", static_cast<int>(row_of(command.queue))},
                       {"args",
                        {{"frame", frame},
                         {"stage", command.stage},
                         {"queued_us", us_since_start(command.queued_ns)},
                         {"submitted_us", us_since_start(command.submitted_ns)}}}});
  }
}

void Trace::write() const {
  expect_new_file("--trace", file_.string());
  vision::write_file(file_, Json{{"displayTimeUnit", "ms"}, {"traceEvents", events_}}.dump(
                                -1, ' ', false, Json::error_handler_t::replace) +
                                '\n');
}

}  // namespace egosgm::app
