// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/image.h"
#include "egosgm/motion.h"
#include "kernels/shared.h"

namespace egosgm::bench {

/// A stereo pair with its disparity maps, for programs without OpenCV: road, facades and boxes under random texture.
/// Disparities are whole pixels, and about a tenth of the pixels have none, as in a tracked map. Equal arguments give
/// equal bits.
struct Street {
  shared::ImageSize size;
  Calibration calibration;
  Motion motion;                     // 0.8 m ahead
  std::vector<std::uint8_t> images;  // both views, the left one first
  std::vector<float> disparity;      // likewise
  std::vector<float> variance;

  ImageView view(int which) const {
    const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
    return {images.data() + which * pixels, size.width, size.height, size.width, PixelType::kU8};
  }
};

/// Disparities reach 5.5 % of the width, as on a road seen by KITTI's cameras, but stay below `disparities`.
Street make_street(shared::ImageSize size, int disparities);

}  // namespace egosgm::bench
