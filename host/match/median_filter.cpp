// SPDX-License-Identifier: Apache-2.0
#include "host/match/median_filter.h"

#include <utility>

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("MedianFilter");
  return context.program("median_filter.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

MedianFilter::MedianFilter(ocl::Context& context, shared::ImageSize size, int pixels)
    : context_((context.enter("MedianFilter"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      filter_(build(context, pixels_), "filter"),
      filter_and_fill_(build(context, pixels_), "filter_and_fill") {}

void MedianFilter::filter(const Map& disparity, Map& filtered, Views views) {
  context_.enter("MedianFilter");
  filter_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, disparity, filtered);
}

void MedianFilter::fill(const Map& disparity, Map& filtered, Map& variance, Views views) {
  context_.enter("MedianFilter");
  filter_and_fill_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, disparity, filtered,
                   variance);
}

}  // namespace egosgm
