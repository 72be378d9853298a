// SPDX-License-Identifier: Apache-2.0
#include "host/median_filter.h"

#include <utility>

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context) {
  context.enter("MedianFilter");
  return context.program("median_filter.cl", {});
}

}  // namespace

MedianFilter::MedianFilter(ocl::Context& context, shared::ImageSize size, const MedianFilterOptions& options)
    : context_(context),
      size_(size),
      enabled_(options.enabled),
      filter_(build(context), "filter"),
      filtered_(context, enabled_ ? 2 * pixel_count(size) : 0) {}

void MedianFilter::operator()(StereoMaps& maps) {
  if (!enabled_) return;
  context_.enter("MedianFilter");
  filter_(context_, ocl::every_pixel(context_, size_), size_, maps.disparity, filtered_);
  std::swap(maps.disparity, filtered_);
}

}  // namespace egosgm
