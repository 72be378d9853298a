// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "apps/cli_names.h"

namespace egosgm::app {

/// Adds one of the options that say where and how a command computes: --device, --fallback, --programs, --cache or
/// --tuning.
void add_device_option(CLI::App& command, const std::string& name, std::string& value);

}  // namespace egosgm::app
