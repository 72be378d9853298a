// SPDX-License-Identifier: Apache-2.0
#include "host/stages/right_map.h"

namespace egosgm {
namespace {

// Rows of whole blocks, with a place behind the image.
std::size_t key_count(shared::ImageSize size, int pixels) {
  return pixel_count({(size.width / pixels + 1) * pixels, size.height});
}

}  // namespace

RightMap::RightMap(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, int pixels)
    : stage_(context, "RightMap", "right_map.cl", size, pixels),
      min_disparity_(range.min),
      keys_(context, key_count(size, stage_.pixels())),
      splat_(stage_, "splat"),
      decode_(stage_, "decode") {}

void RightMap::complete(const StereoMaps& measured, float max_difference_px, StereoMaps& maps, bool makes_variance,
                        cl_int row_step) {
  if (stage_.pixels() == 1) keys_.fill(stage_.enter(), 0);
  stage_.launch_pixels(splat_, /*views=*/1, row_step, min_disparity_, maps.disparity, keys_);
  stage_.launch_pixels(decode_, /*views=*/1, row_step, min_disparity_, max_difference_px, makes_variance, keys_,
                       measured.disparity, measured.variance, maps.disparity, maps.variance);
}

}  // namespace egosgm
