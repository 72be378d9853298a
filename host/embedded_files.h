// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string_view>

namespace egosgm {

/// Data files that are built in, by name (host/CMakeLists.txt).
const std::map<std::string_view, std::string_view>& embedded_files();

}  // namespace egosgm
