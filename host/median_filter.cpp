// SPDX-License-Identifier: Apache-2.0
#include "host/median_filter.h"

#include <utility>

namespace egosgm {
namespace {

constexpr cl_int kFillFrom = 6;  // of eight neighbours

const cl::Program& build(ocl::Context& context, int pixels) {
  context.enter("MedianFilter");
  return context.program("median_filter.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

MedianFilter::MedianFilter(ocl::Context& context, shared::ImageSize size, const MedianFilterOptions& options,
                           int pixels)
    : context_((context.enter("MedianFilter"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      enabled_(options.enabled),
      filter_(build(context, pixels_), "filter"),
      filter_and_fill_(build(context, pixels_), "filter_and_fill"),
      filtered_(context, enabled_ ? 2 * pixel_count(size) : 0) {}

void MedianFilter::operator()(StereoMaps& maps, Holes holes, int views) {
  if (!enabled_) return;
  context_.enter("MedianFilter");
  const ocl::Range pixels = ocl::every_pixels(context_, size_, pixels_, views);
  if (holes == Holes::kFill) {
    filter_and_fill_(context_, pixels, size_, kFillFrom, maps.disparity, filtered_, maps.variance);
  } else {
    filter_(context_, pixels, size_, maps.disparity, filtered_);
  }
  std::swap(maps.disparity, filtered_);
}

}  // namespace egosgm
