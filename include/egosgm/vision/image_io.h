// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "egosgm/export.h"
#include "egosgm/image.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Larger images are refused from their header alone, before anything is allocated.
inline constexpr int kMaxImageSide = 16384;
inline constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 28;

/// Reads a PNG of any colour type or a JPEG, told apart by what they hold, as grey: kU8, or kU16 where a PNG
/// has 16 bits a channel. Colour is weighted as OpenCV's COLOR_RGB2GRAY does; alpha, gamma and orientation are ignored.
/// A file whose pixels would take more than 16 MiB and more than 1032 times its length is refused before they are
/// allocated. Nothing is printed. Throws InvalidArgument, naming the file, where it is missing, too large, truncated,
/// damaged or neither. Thread-safe.
EGOSGM_EXPORT Image read_grey_image(const std::filesystem::path& file);

/// Reads such a file as it is stored: kU8, kU16, kBgr8 or kBgr16, colour as BGR. Throws as read_grey_image
/// does. Thread-safe.
EGOSGM_EXPORT Image read_stored_image(const std::filesystem::path& file);

/// Reads such a file to be looked at: kBgr8, BGR. Colour of 16 bits keeps the upper 8 of as many bits as its values
/// have; grey is stretched as color_grey does. Throws as read_grey_image does. Thread-safe.
EGOSGM_EXPORT Image read_color_image(const std::filesystem::path& file);

/// Whether a grey image of 16 bits holds values below 256 only, as where 8-bit images were saved with 16. The strength
/// of edges, the vertical alignment and the SAD cost look at the upper 8 bits, which are empty then.
EGOSGM_EXPORT bool holds_8_bits_in_16(const Image& grey);

/// Width and height from the header of such a file; the pixels are not looked at. Throws as read_grey_image does.
/// Thread-safe.
EGOSGM_EXPORT Size read_image_size(const std::filesystem::path& file);

/// Writes kU8, kBgr8, kU16 or kBgr16, whole or not at all. Throws IoError, and InvalidArgument for another type
/// or an empty image. Thread-safe for different files.
EGOSGM_EXPORT void write_png(const std::filesystem::path& file, const Image& image);

enum class ColorOrder { kRgb, kBgr };

/// Colours as OpenCV weighs them (COLOR_RGB2GRAY). REQUIRES: three channels or more, of whole numbers.
EGOSGM_EXPORT Image grey_of_colors(const Image& colors, ColorOrder order);

/// Grey (8 or 16 bit; 16 bit is stretched to its own maximum) as BGR.
EGOSGM_EXPORT Image color_grey(const Image& grey);

}  // namespace egosgm::vision
