// SPDX-License-Identifier: Apache-2.0
#include "host/stages/weighted_median.h"

namespace egosgm {

WeightedMedian::WeightedMedian(ocl::Context& context, shared::ImageSize size, PixelType type, int pixels)
    : stage_(context, "WeightedMedian", "weighted_median.cl", size, pixels, pixel_define(type)),
      weigh_(stage_, "weigh") {}

void WeightedMedian::filter(const ocl::Buffer<cl_uchar>& images, const Map& disparity, Map& filtered, Map& variance,
                            Views views) {
  stage_.launch_pixels(weigh_, views.count, views.row_step, images, disparity, filtered, variance);
}

}  // namespace egosgm
