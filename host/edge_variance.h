// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// Variance beside disparity jumps, where a pixel may belong to the other surface: at least `weight` times the square
/// of the range of disparities in its 9x9 window.
class EdgeVariance {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  EdgeVariance(ocl::Context& context, shared::ImageSize size, const EdgeVarianceOptions& options, int pixels = 0);

  /// Replaces the variances of `maps`; nothing happens where the weight is 0. `scratch` is overwritten.
  void operator()(StereoMaps& maps, StereoMaps& scratch);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const int pixels_;
  const float weight_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, ocl::Buffer<float>, ocl::Buffer<float>> row_extremes_;
  ocl::Kernel<const shared::ImageSize, const float, const ocl::Buffer<float>, const ocl::Buffer<float>,
              const ocl::Buffer<float>, ocl::Buffer<float>>
      widen_;
};

}  // namespace egosgm
