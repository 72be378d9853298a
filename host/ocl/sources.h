// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string_view>

namespace egosgm::ocl {

/// The embedded contents of kernels/, by file name.
const std::map<std::string_view, std::string_view>& sources();

}  // namespace egosgm::ocl
