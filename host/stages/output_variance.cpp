// SPDX-License-Identifier: Apache-2.0
#include "host/stages/output_variance.h"

namespace egosgm {

OutputVariance::OutputVariance(ocl::Context& context, shared::ImageSize size, const OutputVarianceOptions& options,
                               int pixels)
    : stage_(context, "OutputVariance", "output_variance.cl", size, pixels),
      options_(options),
      roughness_(context, ocl::Scratch::kOfStage0, 2 * pixel_count(size)),
      mean_variance_(context, ocl::Scratch::kOfStage1, 2 * pixel_count(size)),
      mean_roughness_(context, ocl::Scratch::kOfStage2, 2 * pixel_count(size)),
      of_each_pixel_(stage_, "of_each_pixel"),
      row_means_(stage_, "row_means"),
      combine_(stage_, "combine"),
      keep_(stage_, "keep") {}

void OutputVariance::compute(const Map& output, const StereoMaps& belief, const StereoMaps& measured, Map& variance,
                             Views views) {
  if (!options_.enabled)
    return stage_.launch_pixels(keep_, views.count, views.row_step, output, belief.variance, variance);
  stage_.launch_pixels(of_each_pixel_, views.count, views.row_step, output, belief.disparity, belief.variance,
                       measured.disparity, measured.variance, variance, roughness_);
  stage_.launch_pixels(row_means_, views.count, views.row_step, variance, roughness_, mean_variance_, mean_roughness_);
  stage_.launch_pixels(combine_, views.count, views.row_step, options_.scale, options_.roughness_weight,
                       options_.jump_weight, output, mean_variance_, mean_roughness_, variance);
}

}  // namespace egosgm
