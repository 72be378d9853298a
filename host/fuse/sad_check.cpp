// SPDX-License-Identifier: Apache-2.0
#include "host/fuse/sad_check.h"

#include <utility>

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, PixelType type, int pixels) {
  context.enter("SadCheck");
  return context.program("sad_check.cl",
                         ocl::Defines().set("PIXEL_BYTES", type == PixelType::kU16 ? 2 : 1).set("PIXELS", pixels));
}

}  // namespace

SadCheck::SadCheck(ocl::Context& context, shared::ImageSize size, PixelType type, const SadCheckOptions& options,
                   int pixels)
    : context_(context),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      max_difference_(options.max_difference),
      check_(build(context, type, pixels_), "check_greys") {}

void SadCheck::check(const ocl::Buffer<cl_uchar>& images, Map& disparity, Views views) {
  context_.enter("SadCheck");
  check_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, max_difference_, images,
         disparity);
}

}  // namespace egosgm
