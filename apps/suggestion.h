// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "egosgm/error.h"

namespace egosgm::app {

/// The known name that `typed` was probably meant to be, or empty where none is close.
std::string suggestion(const std::string& typed, const std::vector<std::string>& known);

/// A question that names the path that is there and that the missing one was probably meant to be; else empty.
std::string meant_path(const MissingPath& error);

}  // namespace egosgm::app
