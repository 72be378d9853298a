// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string_view>

#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Most files tell their size within so many bytes; a long comment, profile or thumbnail may stand before it.
inline constexpr std::size_t kUsualJpegHeaderBytes = std::size_t{1} << 16;

bool starts_like_jpeg(std::string_view bytes);

/// Size from the header, within the limits of image_io.h. `file` is only named in errors.
Size parse_jpeg_size(std::string_view bytes, const std::filesystem::path& file);

/// The pixels, 8 bits, one channel or three (RGB). What libjpeg only warns of, such as a file that ends too early, is
/// an error here. An orientation in the file is ignored: calibrations speak of pixels as they are stored.
Image decode_jpeg(std::string_view bytes, const std::filesystem::path& file);

}  // namespace egosgm::vision
