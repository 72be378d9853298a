// SPDX-License-Identifier: Apache-2.0
#include "host/sad_check.h"

#include <utility>

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context, PixelType type) {
  context.enter("SadCheck");
  return context.program("sad_check.cl", ocl::Defines().set("PIXEL_BYTES", type == PixelType::kU16 ? 2 : 1));
}

}  // namespace

SadCheck::SadCheck(ocl::Context& context, shared::ImageSize size, PixelType type, const SadCheckOptions& options)
    : context_(context), size_(size), options_(options), check_(build(context, type), "check") {}

void SadCheck::operator()(const ocl::Buffer<cl_uchar>& images, StereoMaps& in, StereoMaps& out) {
  context_.enter("SadCheck");
  if (options_.max_difference > 0) {
    check_(context_, ocl::every_pixel(context_, size_), size_, options_.max_difference, images, in.disparity,
           in.variance, out.disparity, out.variance);
  } else {
    std::swap(in, out);
  }
}

}  // namespace egosgm
