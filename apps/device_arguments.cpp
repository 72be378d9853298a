// SPDX-License-Identifier: Apache-2.0
#include "apps/device_arguments.h"

namespace egosgm::app {
namespace {

constexpr const char* kGroup = "Method";

}  // namespace

void add_device(CLI::App& command, std::string& device) {
  command
      .add_option("--device", device,
                  "OpenCL device: number, cpu, gpu, or part of its name; NAME/0-3: its first four compute units; see "
                  "egosgm devices")
      ->type_name("NAME")
      ->group(kGroup);
}

void add_fallback(CLI::App& command, std::string& device) {
  command
      .add_option(
          "--fallback", device,
          "where the device fails, go on with this one: what is written stays, frames before are computed again "
          "for the filter's state, and the bits are the same")
      ->type_name("NAME")
      ->group(kGroup);
}

void add_tuning(CLI::App& command, std::string& tuning) {
  command
      .add_option("--tuning", tuning,
                  "sizes of egosgm tune for the device, or none [$XDG_CONFIG_HOME/egosgm/tuning.json if it is there, "
                  "but with --programs none]")
      ->type_name("FILE|none")
      ->group(kGroup);
}

void add_programs(CLI::App& command, std::string& folder) {
  command
      .add_option(
          "--programs", folder,
          "take the kernels from a folder of egosgm compile, and compile nothing; refused where device, driver, "
          "options or version differ")
      ->type_name("DIR")
      ->group(kGroup);
}

void add_cache(CLI::App& command, std::string& cache) {
  command
      .add_option("--cache", cache,
                  "keep what the compiler makes in this folder, whatever the driver keeps, or nowhere [EGOSGM_CACHE; "
                  "else ~/.cache/egosgm for drivers that keep nothing]")
      ->type_name("DIR|off")
      ->group(kGroup);
}

}  // namespace egosgm::app
