// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

bool starts_like_npy(std::string_view bytes);

/// NumPy's array file as kF32: one H x W array (further sides of length 1 are dropped) of floats of 2, 4 or 8 bytes
/// or integers of 1, 2 or 4, either byte order, rows or columns first. `file` is only named in errors.
Image parse_npy(std::string_view bytes, const std::filesystem::path& file);

}  // namespace egosgm::vision
