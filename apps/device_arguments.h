// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace egosgm::app {

/// --device NAME.
void add_device(CLI::App& command, std::string& device);
/// --fallback NAME.
void add_fallback(CLI::App& command, std::string& device);
/// --tuning: a file of `egosgm tune`, or none; empty: the user's.
void add_tuning(CLI::App& command, std::string& tuning);
/// --cache: a folder, or off; empty: as EGOSGM_CACHE says.
void add_cache(CLI::App& command, std::string& cache);
/// --programs DIR.
void add_programs(CLI::App& command, std::string& folder);

}  // namespace egosgm::app
