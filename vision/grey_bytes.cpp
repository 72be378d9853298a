// SPDX-License-Identifier: Apache-2.0
#include "vision/grey_bytes.h"

#include "egosgm/vision/image.h"
#include "host/grey_levels.h"

namespace egosgm::vision {

std::pair<Image, Image> bytes_of(const Image& left, const Image& right) {
  if (left.type.channel == ChannelType::kU8) return {left, right};
  const GreyLevels levels = levels_of(image_view(left), image_view(right));
  const auto bytes = [&](const Image& image) {
    Image result(image.size(), kU8);
    for (int y = 0; y < image.rows; ++y) {
      std::transform(image.row<std::uint16_t>(y), image.row<std::uint16_t>(y) + image.cols, result.row(y), levels);
    }
    return result;
  };
  return {bytes(left), bytes(right)};
}

}  // namespace egosgm::vision
