// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace egosgm::app {

/// What becomes of the maps that an earlier run left in OUT: they are in the way, they are removed, or they stay and
/// the run goes on after them.
enum class EarlierRun { kRefuse, kOverwrite, kResume };

/// Sees to OUT before a run. `identity`: what the maps depend on (RunReport::identity).
/// Throws InvalidArgument, having touched nothing, where an earlier run is in the way or differs in its identity.
void expect_free(const std::filesystem::path& out, EarlierRun treatment, const nlohmann::ordered_json& identity);

}  // namespace egosgm::app
