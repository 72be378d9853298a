// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/maps.h"
#include "host/method_options.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// The variance that is given out, of a disparity that may lie on a wrong surface too, from the filter's p and the
/// measurement's r, which are of a pixel on the right one: s = scale * (mean of (p r^3)^(1/4) over 17x17 pixels)^1.5 +
/// roughness_weight * (mean over 7x7 pixels of how far the disparity is from a plane's)^2 + jump_weight * (largest
/// difference to the disparities two pixels off)^2; and of this sum
/// RIGHT_SURFACE_PX2 s^2 / (s^2 + RIGHT_SURFACE_HALF) + WRONG_SURFACE_PX2 sqrt(s) s^5 / (s^5 + WRONG_SURFACE_HALF), the
/// constants EGOSGM_... of kernels/method.h.
class OutputVariance {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  OutputVariance(ocl::Context& context, shared::ImageSize size, const OutputVarianceOptions& options, int pixels = 0);

  /// Writes `variance` [px^2], 0 where there is no disparity. `measured`: what the frame of `maps` measured; may be
  /// `maps`.
  void compute(const StereoMaps& maps, const StereoMaps& measured, Map& variance, Views views);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const OutputVarianceOptions options_;
  const int pixels_;
  Map roughness_, mean_variance_, mean_roughness_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, const ocl::Buffer<float>, const ocl::Buffer<float>,
              const ocl::Buffer<float>, ocl::Buffer<float>, ocl::Buffer<float>>
      of_each_pixel_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, const ocl::Buffer<float>, ocl::Buffer<float>,
              ocl::Buffer<float>>
      row_means_;
  ocl::Kernel<const shared::ImageSize, const float, const float, const float, const ocl::Buffer<float>,
              const ocl::Buffer<float>, const ocl::Buffer<float>, ocl::Buffer<float>>
      combine_;
};

}  // namespace egosgm
