// SPDX-License-Identifier: Apache-2.0
// PNG as cameras' programs and this one write it: grey of 8 or 16 bits or RGB of 8, not interlaced, without a palette.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// The pixels as stored, of a file whose header says `size`; nothing where it is not plain, or not whole: libpng reads
/// the former and says what is wrong with the latter. Several times as fast as libpng.
/// REQUIRES: bytes that parse_png_size took, and `size` of it.
std::optional<Image> decode_plain_png(std::string_view bytes, Size size, const std::filesystem::path& file);

/// A file with these pixels. REQUIRES: kU8, kBgr8, kU16 or kBgr16, not empty.
std::string encode_plain_png(const Image& image);

}  // namespace egosgm::vision
