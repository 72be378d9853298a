// SPDX-License-Identifier: Apache-2.0
#include "host/stages/sad_check.h"

namespace egosgm {

SadCheck::SadCheck(ocl::Context& context, shared::ImageSize size, PixelType type, const SadCheckOptions& options,
                   int pixels)
    : stage_(context, "SadCheck", "sad_check.cl", size, pixels, pixel_define(type)),
      max_difference_(options.max_difference),
      check_(stage_, "check_greys") {}

void SadCheck::check(const ocl::Buffer<cl_uchar>& images, Map& disparity, Views views) {
  stage_.launch_pixels(check_, views.count, max_difference_, images, disparity);
}

}  // namespace egosgm
