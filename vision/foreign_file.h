// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "egosgm/export.h"

namespace egosgm::vision {

inline constexpr std::size_t kKindBytes = 300;  // of a file, which tell its kind
inline constexpr const char* kRecording = "it is a recording of ROS, which `egosgm run` and `doctor` read";

/// What a file is that people give in place of an image or of a sequence, by its first bytes, else by its name, and
/// what to do with it: "it is a zip archive: unpack it". Empty where that is not known. Thread-safe.
EGOSGM_EXPORT std::string foreign_kind(std::string_view start, const std::filesystem::path& file);

/// Whether it is a file of a video. Thread-safe.
EGOSGM_EXPORT bool is_video(const std::filesystem::path& file);

/// The same of a path that is no folder: what it holds, or the camera that it names. Thread-safe.
std::string foreign_input(const std::filesystem::path& path);

}  // namespace egosgm::vision
