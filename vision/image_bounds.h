// SPDX-License-Identifier: Apache-2.0
// Bounds of an image file: asked of every file from its header, before its pixels are decoded or allocated.
#pragma once

#include <cstdint>
#include <filesystem>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

inline constexpr std::size_t kMaxImageFileBytes = std::size_t{1} << 30;

/// Pixels as they are in memory after decoding: a file may take this much whatever its length, and
inline constexpr std::int64_t kAlwaysAllowedBytes = std::int64_t{16} << 20;
/// this many times its length: what an image of one grey of 8 bits needs (zlib's "Maximum Expansion Factor").
inline constexpr std::int64_t kMaxExpansion = 1032;

/// The size, if it is within the limits of image_io.h. Throws InvalidArgument, naming the file.
Size checked_image_size(std::int64_t width, std::int64_t height, const std::filesystem::path& file);

/// Throws InvalidArgument where pixels of `type` would take more than a file of `file_bytes` may.
void check_decoded_bytes(Size size, ImageType type, std::size_t file_bytes, const std::filesystem::path& file);

/// Throws InvalidArgument.
[[noreturn]] void refuse_image(const std::filesystem::path& file, const std::string& why);

}  // namespace egosgm::vision
