// SPDX-License-Identifier: Apache-2.0
#include "host/publish/output_variance.h"

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("OutputVariance");
  return context.program("output_variance.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

OutputVariance::OutputVariance(ocl::Context& context, shared::ImageSize size, const OutputVarianceOptions& options,
                               int pixels)
    : context_((context.enter("OutputVariance"), context)),
      size_(size),
      options_(options),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      roughness_(context, ocl::Scratch::kOfStage0, 2 * pixel_count(size)),
      mean_variance_(context, ocl::Scratch::kOfStage1, 2 * pixel_count(size)),
      mean_roughness_(context, ocl::Scratch::kOfStage2, 2 * pixel_count(size)),
      of_each_pixel_(build(context, pixels_), "of_each_pixel"),
      row_means_(build(context, pixels_), "row_means"),
      combine_(build(context, pixels_), "combine"),
      keep_(build(context, pixels_), "keep") {}

void OutputVariance::compute(const Map& given_out, const StereoMaps& belief, const StereoMaps& measured, Map& variance,
                             Views views) {
  context_.enter("OutputVariance");
  const ocl::Range pixels = ocl::every_pixels(context_, size_, pixels_, count(views));
  if (!options_.enabled) return keep_(context_, pixels, size_, given_out, belief.variance, variance);
  of_each_pixel_(context_, pixels, size_, given_out, belief.disparity, belief.variance, measured.disparity,
                 measured.variance, variance, roughness_);
  row_means_(context_, pixels, size_, variance, roughness_, mean_variance_, mean_roughness_);
  combine_(context_, pixels, size_, options_.scale, options_.roughness_weight, options_.jump_weight, given_out,
           mean_variance_, mean_roughness_, variance);
}

}  // namespace egosgm
