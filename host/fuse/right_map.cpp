// SPDX-License-Identifier: Apache-2.0
#include "host/fuse/right_map.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("RightMap");
  return context.program("right_map.cl", ocl::Defines().set("PIXELS", pixels));
}

// Rows of whole blocks, with a place behind the image.
std::size_t key_count(shared::ImageSize size, int pixels) {
  return pixel_count({(size.width / pixels + 1) * pixels, size.height});
}

}  // namespace

RightMap::RightMap(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, int pixels)
    : context_((context.enter("RightMap"), context)),
      size_(size),
      min_disparity_(range.min),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      keys_(context, key_count(size, pixels_)),
      splat_(build(context, pixels_), "splat"),
      decode_(build(context, pixels_), "decode") {}

void RightMap::complete(const StereoMaps& measured, float max_difference_px, StereoMaps& maps, bool makes_variance) {
  context_.enter("RightMap");
  const ocl::Range pixels = ocl::every_pixels(context_, size_, pixels_, /*views=*/1);
  if (pixels_ == 1) keys_.fill(context_, 0);
  splat_(context_, pixels, size_, min_disparity_, maps.disparity, keys_);
  const cl_int with_variance = makes_variance ? 1 : 0;
  decode_(context_, pixels, size_, min_disparity_, max_difference_px, with_variance, keys_, measured.disparity,
          measured.variance, maps.disparity, maps.variance);
}

}  // namespace egosgm
