// SPDX-License-Identifier: Apache-2.0
#include "host/stages/median_filter.h"

namespace egosgm {

MedianFilter::MedianFilter(ocl::Context& context, shared::ImageSize size, int pixels)
    : stage_(context, "MedianFilter", "median_filter.cl", size, pixels), filter_(stage_, "filter") {}

void MedianFilter::filter(const Map& disparity, Map& filtered, Views views) {
  stage_.launch_pixels(filter_, views.count, views.row_step, disparity, filtered);
}

}  // namespace egosgm
