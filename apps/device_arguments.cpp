// SPDX-License-Identifier: Apache-2.0
#include "apps/device_arguments.h"

#include "apps/option_group.h"

namespace egosgm::app {
namespace {

constexpr const char* kGroup = "Method";

}  // namespace

void add_device(CLI::App& command, std::string& device) {
  OptionGroup(command, kGroup)
      .add("--device", device, "NAME",
           "OpenCL device: number, cpu, gpu, or part of its name; NAME/0-3: its first four compute units; see "
           "egosgm devices");
}

void add_fallback(CLI::App& command, std::string& device) {
  OptionGroup(command, kGroup)
      .add("--fallback", device, "NAME",
           "where the device fails, go on with this one: what is written stays, frames before are computed again "
           "for the filter's state, and the bits are the same");
}

void add_tuning(CLI::App& command, std::string& tuning) {
  OptionGroup(command, kGroup)
      .add("--tuning", tuning, "FILE|none",
           "sizes of egosgm tune for the device, or none [$XDG_CONFIG_HOME/egosgm/tuning.json if it is there, "
           "but with --programs none]");
}

void add_programs(CLI::App& command, std::string& folder) {
  OptionGroup(command, kGroup)
      .add("--programs", folder, "DIR",
           "take the kernels from a folder of egosgm compile, and compile nothing; refused where device, driver, "
           "options or version differ");
}

void add_cache(CLI::App& command, std::string& cache) {
  OptionGroup(command, kGroup)
      .add("--cache", cache, "DIR|off",
           "keep what the compiler makes in this folder, whatever the driver keeps, or nowhere [EGOSGM_CACHE; "
           "else ~/.cache/egosgm for drivers that keep nothing]");
}

}  // namespace egosgm::app
