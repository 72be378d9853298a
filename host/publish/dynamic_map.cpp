// SPDX-License-Identifier: Apache-2.0
#include "host/publish/dynamic_map.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("DynamicMap");
  return context.program("dynamic_map.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

DynamicMap::DynamicMap(ocl::Context& context, shared::ImageSize size, const DynamicMapOptions& options, int pixels)
    : context_((context.enter("DynamicMap"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      min_difference_px_(options.min_difference_px),
      both_(context, pixel_count(size)),
      differing_(context, pixel_count(size)),
      count_rows_(build(context, pixels_), "count_rows"),
      mark_(build(context, pixels_), "mark") {}

void DynamicMap::operator()(const Map& predicted, const Map& measured, ocl::Buffer<cl_uchar>& marks) {
  context_.enter("DynamicMap");
  const ocl::Range pixels = ocl::every_pixels(context_, size_, pixels_, /*views=*/1);
  count_rows_(context_, pixels, size_, min_difference_px_, predicted, measured, both_, differing_);
  mark_(context_, pixels, size_, predicted, measured, both_, differing_, marks);
}

}  // namespace egosgm
