// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// What contradicts a static world, of the left view: 255 at a pixel with a prediction and a measurement where, of the
/// pixels of its 9x9 window that have both, at least half differ by more than `min_difference_px`, if a third of the
/// window has both; else 0.
class DynamicMap {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  DynamicMap(ocl::Context& context, shared::ImageSize size, const DynamicMapOptions& options, int pixels = 0);

  /// By the disparities `predicted` and `measured`. `marks`: a byte a pixel.
  void operator()(const Map& predicted, const Map& measured, ocl::Buffer<cl_uchar>& marks);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const int pixels_;
  const float min_difference_px_;
  Map both_, differing_;  // of each pixel, in its row
  ocl::Kernel<const shared::ImageSize, const float, const ocl::Buffer<float>, const ocl::Buffer<float>,
              ocl::Buffer<float>, ocl::Buffer<float>>
      count_rows_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, const ocl::Buffer<float>, const ocl::Buffer<float>,
              const ocl::Buffer<float>, ocl::Buffer<cl_uchar>>
      mark_;
};

}  // namespace egosgm
