// SPDX-License-Identifier: Apache-2.0
#include "apps/device_arguments.h"

#include <CLI/App.hpp>
#include <map>
#include <utility>

#include "apps/option_group.h"

namespace egosgm::app {

void add_device_option(CLI::App& command, const std::string& name, std::string& value) {
  static const std::map<std::string, std::pair<const char*, const char*>> kOptions{
      {"--device",
       {"NAME",
        "OpenCL device: number, cpu, gpu, or part of its name; NAME/0-3: its first four compute units; see egosgm "
        "devices"}},
      {"--fallback",
       {"NAME",
        "where the device fails, go on with this one: what is written stays, frames before are computed again for the "
        "filter's state, and the bits are the same"}},
      {"--programs",
       {"DIR",
        "take the kernels from a folder of egosgm compile, and compile nothing; refused where device, driver, options "
        "or version differ"}},
      {"--cache",
       {"DIR|off",
        "keep what the compiler makes in this folder, whatever the driver keeps, or nowhere [EGOSGM_CACHE; else "
        "~/.cache/egosgm for drivers that keep nothing]"}},
      {"--tuning",
       {"FILE|none",
        "sizes of egosgm tune for the device, or none [$XDG_CONFIG_HOME/egosgm/tuning.json if it is there, but with "
        "--programs none]"}}};
  const auto& [type, text] = kOptions.at(name);
  OptionGroup(command, "Method").add(name.c_str(), value, type, text);
}

}  // namespace egosgm::app
