// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// The right view's disparities and variances by the left view's. Where the right view was measured: those of the left
/// pixel that it sees, or the measurement if they contradict it. Elsewhere those of the nearest left surface that lands
/// there, every left pixel (x, d) on the right pixel nearest to x - d; or none.
class RightMap {
 public:
  /// `pixels` of a work-item: 1 (and atomics) or 16 (a row); 0: by the device. Same bits.
  RightMap(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range, int pixels = 0);

  /// From the left half of `maps` and the right one of `measured` to the right half of `maps`. What differs by more
  /// than `max_difference_px` contradicts. The variances only where `makes_variance`. REQUIRES: no disparity lies more
  /// than half a pixel below the range.
  void complete(const StereoMaps& measured, float max_difference_px, StereoMaps& maps, bool makes_variance,
                cl_int row_step = 1);

 private:
  ocl::Stage stage_;
  const cl_int min_disparity_;
  ocl::Buffer<cl_int> keys_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, const ocl::Buffer<float>, ocl::Buffer<cl_int>>
      splat_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, const float, const cl_int, const ocl::Buffer<cl_int>,
              const ocl::Buffer<float>, const ocl::Buffer<float>, ocl::Buffer<float>, ocl::Buffer<float>>
      decode_;
};

}  // namespace egosgm
