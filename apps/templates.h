// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string_view>

namespace egosgm::app {

/// The embedded pages that the program fills in, by file name.
const std::map<std::string_view, std::string_view>& templates();

}  // namespace egosgm::app
