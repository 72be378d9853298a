// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// Every valid disparity becomes the median of its 3x3 window, in both views. A neighbour outside the image or without
/// a value votes for the centre. Invalid pixels stay invalid; every pixel keeps its variance.
class MedianFilter {
 public:
  MedianFilter(ocl::Context& context, shared::ImageSize size, const MedianFilterOptions& options);

  /// Replaces the disparities of `maps`; nothing happens where the option is off.
  void operator()(StereoMaps& maps);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const bool enabled_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, ocl::Buffer<float>> filter_;
  ocl::Buffer<float> filtered_;
};

}  // namespace egosgm
