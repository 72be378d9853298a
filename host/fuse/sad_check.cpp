// SPDX-License-Identifier: Apache-2.0
#include "host/fuse/sad_check.h"

#include <utility>

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context, PixelType type) {
  context.enter("SadCheck");
  return context.program("sad_check.cl", ocl::Defines().set("PIXEL_BYTES", type == PixelType::kU16 ? 2 : 1));
}

}  // namespace

SadCheck::SadCheck(ocl::Context& context, shared::ImageSize size, PixelType type, const SadCheckOptions& options)
    : context_(context), size_(size), max_difference_(options.max_difference), check_(build(context, type), "check") {}

void SadCheck::operator()(const ocl::Buffer<cl_uchar>& images, StereoMaps& maps) {
  context_.enter("SadCheck");
  check_(context_, ocl::every_pixel(context_, size_), size_, max_difference_, images, maps.disparity, maps.variance);
}

}  // namespace egosgm
