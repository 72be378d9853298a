// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// The right view's disparities and variances as the left view's surfaces say: every left pixel (x, d) lands on the
/// right pixel nearest to x - d. What was measured wins over what was not, then the nearest surface; where nothing
/// lands, there is no disparity.
class RightMap {
 public:
  /// `pixels` of a work-item: 1 (and atomics) or 16 (a row); 0: by the device. Same bits.
  RightMap(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, int pixels = 0);

  /// From the left half of `maps` to its right one. Measured is what differs by at most `max_difference_px` from what
  /// `measured` has in its left half. REQUIRES: no disparity lies more than half a pixel below the range.
  void operator()(const StereoMaps& measured, float max_difference_px, StereoMaps& maps);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const cl_int min_disparity_;
  const int pixels_;
  ocl::Buffer<cl_uint> keys_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const ocl::Buffer<float>, const ocl::Buffer<float>,
              ocl::Buffer<cl_uint>>
      splat_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const ocl::Buffer<cl_uint>, ocl::Buffer<float>, ocl::Buffer<float>>
      decode_;
};

}  // namespace egosgm
