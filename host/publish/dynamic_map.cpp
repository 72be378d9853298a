// SPDX-License-Identifier: Apache-2.0
#include "host/publish/dynamic_map.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("DynamicMap");
  return context.program("dynamic_map.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

DynamicMap::DynamicMap(ocl::Context& context, shared::ImageSize size, int pixels)
    : context_((context.enter("DynamicMap"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      mark_(build(context, pixels_), "mark") {}

void DynamicMap::mark(const Map& predicted, const Map& measured, ocl::Buffer<cl_uchar>& marks) {
  context_.enter("DynamicMap");
  mark_(context_, ocl::every_pixels(context_, size_, pixels_, /*views=*/1), size_, predicted, measured, marks);
}

}  // namespace egosgm
