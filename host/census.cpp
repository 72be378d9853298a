// SPDX-License-Identifier: Apache-2.0
#include "host/census.h"

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context, PixelType type, MatchingCost window) {
  context.enter("Census");
  return context.program("census.cl", ocl::Defines()
                                          .set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2)
                                          .set("RADIUS_X", window == MatchingCost::kCensus5x5 ? 2 : 4)
                                          .set("RADIUS_Y", window == MatchingCost::kCensus5x5 ? 2 : 3));
}

}  // namespace

Census::Census(ocl::Context& context, shared::ImageSize size, PixelType type, MatchingCost window, int padding)
    : context_(context), size_(size), padding_(padding), census_(build(context, type, window), "census") {}

void Census::operator()(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_ulong>& codes) {
  context_.enter("Census");
  census_(context_, ocl::every_row(size_), size_, padding_, images, codes);
}

}  // namespace egosgm
