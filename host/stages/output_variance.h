// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// The variance that is published, of a disparity that may lie on a wrong surface too, from the filter's p and the
/// measurement's r, which are of a pixel on the right one: s = scale * (mean of (p r^3)^(1/4) over 17x17 pixels)^1.5 +
/// roughness_weight * (mean over 7x7 pixels of how far the disparity is from a plane's)^2 + jump_weight * (largest
/// difference to the disparities two pixels off)^2; and of this sum
/// RIGHT_SURFACE_PX2 s^2 / (s^2 + RIGHT_SURFACE_HALF) + WRONG_SURFACE_PX2 sqrt(s) s^5 / (s^5 + WRONG_SURFACE_HALF), the
/// constants EGOSGM_... of kernels/method.h. Where the options say so, it is the filter's p instead.
class OutputVariance {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  OutputVariance(ocl::Context& context, shared::ImageSize size, const OutputVarianceOptions& options, int pixels = 0);

  /// Writes the variance [px^2] of the disparities that are published of a belief; 0 where there is none. `measured`:
  /// what the belief's frame measured; may be the belief. Of `views`, all have the rows of row_step alone.
  void compute(const Map& output, const StereoMaps& belief, const StereoMaps& measured, Map& variance, Views views);

 private:
  ocl::Stage stage_;
  const OutputVarianceOptions options_;
  Map roughness_, mean_variance_, mean_roughness_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const Map, const Map, const Map, const Map, const Map, Map, Map>
      of_each_pixel_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const Map, const Map, Map, Map> row_means_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const float, const float, const Map, const Map,
              const Map, Map>
      combine_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const Map, const Map, Map> keep_;
};

}  // namespace egosgm
