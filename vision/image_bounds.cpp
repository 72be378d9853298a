// SPDX-License-Identifier: Apache-2.0
#include "vision/image_bounds.h"

#include <algorithm>
#include <string>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"

namespace egosgm::vision {

Size checked_image_size(std::int64_t width, std::int64_t height, const std::filesystem::path& file) {
  if (width <= 0 || height <= 0) refuse_image(file, "its width or height is zero");
  if (width > kMaxImageSide || height > kMaxImageSide || width * height > kMaxImagePixels) {
    throw InvalidArgument(file.string() + ": an image of " + std::to_string(width) + "x" + std::to_string(height) +
                          " is larger than the limit of " + std::to_string(kMaxImageSide) + " a side and " +
                          std::to_string(kMaxImagePixels) + " pixels; give a smaller one");
  }
  return {static_cast<int>(width), static_cast<int>(height)};
}

void check_decoded_bytes(Size size, ImageType type, std::size_t file_bytes, const std::filesystem::path& file) {
  const std::int64_t decoded = std::int64_t{size.width} * size.height * type.pixel_bytes();
  if (decoded <= std::max(kAlwaysAllowedBytes, kMaxExpansion * static_cast<std::int64_t>(file_bytes))) return;
  refuse_image(file, std::to_string(file_bytes) + " bytes are too short for " + std::to_string(size.width) + "x" +
                         std::to_string(size.height) + " pixels, which take " + std::to_string(decoded));
}

void refuse_image(const std::filesystem::path& file, const std::string& why) {
  throw InvalidArgument(file.string() + ": not a readable image (truncated?): " + why +
                        "; give an intact PNG or JPEG file");
}

}  // namespace egosgm::vision
