// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// What becomes of a pixel without a disparity: it stays one, or takes the median of its neighbours, with a variance of
/// 1 px^2, if at least six of the eight have a value.
enum class Holes { kLeave, kFill };

/// Every valid disparity becomes the median of its 3x3 window, in both views, and keeps its variance. A neighbour
/// outside the image or without a value votes for the centre.
class MedianFilter {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  MedianFilter(ocl::Context& context, shared::ImageSize size, const MedianFilterOptions& options, int pixels = 0);

  /// Replaces the disparities of `maps`; nothing happens where the option is off. `views`: 1 filters the left view
  /// only; the right view's part of the disparities is then left undefined.
  void operator()(StereoMaps& maps, Holes holes, int views = 2);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const int pixels_;
  const bool enabled_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, ocl::Buffer<float>> filter_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const ocl::Buffer<float>, ocl::Buffer<float>, ocl::Buffer<float>>
      filter_and_fill_;
  ocl::Buffer<float> filtered_;
};

}  // namespace egosgm
