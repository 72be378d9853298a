// SPDX-License-Identifier: Apache-2.0
// What a file or a folder is that a user names, for the program and for the Python package.
#pragma once

#include <filesystem>

#include "egosgm/export.h"

namespace egosgm::vision {

/// Whether ROS recorded it: a .bag, .mcap or .db3, also packed (.zstd); a folder whose metadata.yaml is a bag's, or
/// with such files and no folders. Thread-safe.
EGOSGM_EXPORT bool is_bag(const std::filesystem::path& path);

/// Whether it is a file in a format of read_calibration, right or wrong. Thread-safe.
EGOSGM_EXPORT bool is_own_calibration(const std::filesystem::path& path);

}  // namespace egosgm::vision
