// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Every valid disparity becomes the median of its 3x3 window and keeps its variance. A neighbour outside the image or
/// without a value votes for the centre. A pixel without a disparity stays one.
class MedianFilter {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  MedianFilter(ocl::Context& context, shared::ImageSize size, int pixels = 0);

  void filter(const Map& disparity, Map& filtered, Views views);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const ocl::Buffer<float>, ocl::Buffer<float>> filter_;
};

}  // namespace egosgm
