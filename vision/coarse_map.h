// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "egosgm/export.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// Disparities [px, of the images' own size] of images made smaller, sought from minus to plus half the width; kNoValue
/// where nothing is sure. One outside of [least, end), the range that is to be searched, counts only where none in it
/// explains the images nearly as well, as where texture repeats. The right image's rows lie row_offset_px further
/// down. REQUIRES: images of one size, both kU8 or both kU16. Thread-safe.
EGOSGM_EXPORT Image coarse_map(const Image& left, const Image& right, double row_offset_px, int least, int end);

/// The parts of a pair that are nearer and farther than the range of disparities reaches, by its coarse map.
struct Clipped {
  double near_share, far_share;  // of the pixels of which the map is sure; 0 where hardly anything is
  int disparities;               // with which the range would hold nearly all that is near
  int min_disparity;             // with which it would hold nearly all that is far
};

/// None where hardly anything is outside, or where the map is sure of too little. REQUIRES: as coarse_map, rectified
/// images. Thread-safe.
EGOSGM_EXPORT std::optional<Clipped> clipped_by_range(const Image& left, const Image& right, int least, int end);

}  // namespace egosgm::vision
