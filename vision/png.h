// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

inline constexpr std::size_t kPngHeaderBytes = 33;  // signature, IHDR with its length and checksum

bool starts_like_png(std::string_view bytes);

/// Size from the signature and IHDR, within the limits of image_io.h. `file` is only named in errors.
Size parse_png_size(std::string_view bytes, const std::filesystem::path& file);

/// The pixels as stored: 8 or 16 bits, one channel or three (RGB); less than 8 bits and palettes are widened, alpha is
/// dropped.
Image decode_png(std::string_view bytes, const std::filesystem::path& file);

}  // namespace egosgm::vision
