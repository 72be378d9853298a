// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace egosgm::app {

/// --device NAME.
void add_device(CLI::App& command, std::string& device);
/// --programs DIR.
void add_programs(CLI::App& command, std::string& folder);

}  // namespace egosgm::app
