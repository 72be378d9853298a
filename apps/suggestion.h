// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace egosgm::app {

/// The known name that `typed` was probably meant to be, or empty where none is close.
std::string suggestion(const std::string& typed, const std::vector<std::string>& known);

}  // namespace egosgm::app
