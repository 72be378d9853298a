// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <fmt/ranges.h>

#include <CLI/App.hpp>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/run_report.h"
#include "egosgm/device.h"

namespace egosgm::app {
namespace {

bool same_device(const DeviceInfo& a, const DeviceInfo& b) {
  return a.name == b.name && a.platform == b.platform && a.driver == b.driver;
}

std::string reason_of_default(const DeviceInfo& chosen) {
  const char* wanted = std::getenv("EGOSGM_DEVICE");
  if (wanted && *wanted) return fmt::format("the environment variable EGOSGM_DEVICE is \"{}\"", wanted);
  return fmt::format(
      "GPUs come before accelerators, those before CPUs, and this {} is the first; --device or EGOSGM_DEVICE chooses "
      "another",
      to_string(chosen.type));
}

void print_device(std::size_t index, const DeviceInfo& info, bool is_default) {
  constexpr double gibibyte = 1024.0 * 1024.0 * 1024.0;
  fmt::print("{} {}  {}\n", is_default ? '*' : ' ', index, info.name);
  fmt::print("     {}, {}, {}, {:.1f} GiB memory, {:.1f} GiB in one buffer\n", to_string(info.type), info.vendor,
             counted(info.compute_units, "compute unit"), static_cast<double>(info.memory_bytes) / gibibyte,
             static_cast<double>(info.max_allocation_bytes) / gibibyte);
  fmt::print("     {}; {}; driver {}\n", info.platform, info.version, info.driver);
  if (!info.lacks.empty()) fmt::print("     does not promise: {}\n", fmt::join(info.lacks, ", "));
}

nlohmann::ordered_json listed(const DeviceInfo& info, bool is_default) {
  nlohmann::ordered_json json = json_of(info);
  json.update({{"memory_bytes", info.memory_bytes},
               {"max_allocation_bytes", info.max_allocation_bytes},
               {"lacks", info.lacks},
               {"default", is_default}});
  return json;
}

int list_devices(bool json) {
  const DeviceInfo chosen = Device::select().info();  // says how to install one where there is none
  const std::vector<Device> devices = Device::list();
  auto list = nlohmann::ordered_json::array();
  bool found = false;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const DeviceInfo& info = devices[i].info();
    const bool is_default = !found && same_device(info, chosen);
    found = found || is_default;
    if (json) {
      list.push_back(listed(info, is_default));
    } else {
      print_device(i, info, is_default);
    }
  }
  if (json) {
    fmt::print("{}\n", list.dump(2));
  } else {
    fmt::print("\n* is taken by default: {}.\n", reason_of_default(chosen));
  }
  return kOk;
}

}  // namespace

Command add_devices(CLI::App& program) {
  CLI::App* command = program.add_subcommand("devices", "List the OpenCL devices, and which one is taken by default");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "print JSON");
  return {command, [json] { return list_devices(*json); }};
}

}  // namespace egosgm::app
