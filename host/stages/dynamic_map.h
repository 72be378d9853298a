// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Finds what contradicts a static world, in the left view: 255 at a pixel with a prediction and a measurement where,
/// of every second pixel of its 9x9 window, at least half of those that have both differ, if a third has both; else 0.
class DynamicMap {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  DynamicMap(ocl::Context& context, shared::ImageSize size, int pixels = 0);

  /// By the disparities `predicted` and `measured`. `marks`: a byte a pixel.
  void mark(const Map& predicted, const Map& measured, ocl::Buffer<cl_uchar>& marks);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::ImageSize, const Map, const Map, ocl::Buffer<cl_uchar>> mark_;
};

}  // namespace egosgm
