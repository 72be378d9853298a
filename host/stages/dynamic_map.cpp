// SPDX-License-Identifier: Apache-2.0
#include "host/stages/dynamic_map.h"

namespace egosgm {

DynamicMap::DynamicMap(ocl::Context& context, shared::ImageSize size, int pixels)
    : stage_(context, "DynamicMap", "dynamic_map.cl", size, pixels), mark_(stage_, "mark") {}

void DynamicMap::mark(const Map& predicted, const Map& measured, ocl::Buffer<cl_uchar>& marks) {
  stage_.launch_pixels(mark_, /*views=*/1, predicted, measured, marks);
}

}  // namespace egosgm
