// SPDX-License-Identifier: Apache-2.0
#include "host/stages/weighted_median.h"

#include <cstdint>

namespace egosgm {
namespace {

/// The largest power of two with which 15 bits hold so many pixels.
float steps_per_px_of(int pixels) {
  int steps = 1 << 13;
  while (steps * std::int64_t{pixels} >= 1 << 15) steps /= 2;
  return static_cast<float>(steps);
}

}  // namespace

WeightedMedian::WeightedMedian(ocl::Context& context, shared::ImageSize size, PixelType type,
                               shared::DisparityRange range, int pixels)
    : stage_(context, "WeightedMedian", "weighted_median.cl", size, pixels, pixel_define(type)),
      least_(static_cast<float>(range.min - 1)),
      steps_per_px_(steps_per_px_of(range.count + 2)),
      weigh_(stage_, "weigh") {}

void WeightedMedian::filter(const ocl::Buffer<cl_uchar>& images, const Map& disparity, Map& filtered, Map& variance,
                            Views views) {
  stage_.launch_pixels(weigh_, views.count, views.row_step, least_, steps_per_px_, images, disparity, filtered,
                       variance);
}

}  // namespace egosgm
