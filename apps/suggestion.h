// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace egosgm::app {

/// The known name that `typed` was probably meant to be, or empty where none is close.
std::string suggestion(const std::string& typed, const std::vector<std::string>& known);

/// The path that is there and that `typed`, which is not, was probably meant to be; else empty.
std::string path_suggestion(const std::filesystem::path& typed);

}  // namespace egosgm::app
