// SPDX-License-Identifier: Apache-2.0
#include "host/edge_variance.h"

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context, int pixels) {
  context.enter("EdgeVariance");
  return context.program("edge_variance.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

EdgeVariance::EdgeVariance(ocl::Context& context, shared::ImageSize size, const EdgeVarianceOptions& options,
                           int pixels)
    : context_((context.enter("EdgeVariance"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      weight_(options.weight),
      row_extremes_(build(context, pixels_), "row_extremes"),
      widen_(build(context, pixels_), "widen") {}

void EdgeVariance::operator()(StereoMaps& maps, StereoMaps& scratch) {
  if (weight_ == 0) return;
  context_.enter("EdgeVariance");
  const ocl::Range pixels = ocl::every_pixels(context_, size_, pixels_);
  row_extremes_(context_, pixels, size_, maps.disparity, scratch.disparity, scratch.variance);
  widen_(context_, pixels, size_, weight_, maps.disparity, scratch.disparity, scratch.variance, maps.variance);
}

}  // namespace egosgm
