// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/image.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Every valid disparity becomes the median of those on a circle of 4 pixels around it, weighted by how near the grey
/// values are, and keeps its variance (Ma et al., Constant time weighted median filtering for stereo matching and
/// beyond, ICCV 2013).
class WeightedMedian {
 public:
  /// `range`: of the disparities. `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  WeightedMedian(ocl::Context& context, shared::ImageSize size, PixelType type, shared::DisparityRange range,
                 int pixels = 0);

  /// Votes that are less than a step apart count as equal, and the pixel's own is the first of these. 15 bits
  /// can count the steps over the whole range: 1/128 px of 128 disparities. A pixel without a disparity takes the
  /// median of the others, with a variance of 1 px^2, if at least six of the eight have a value and are about as
  /// bright. `images`: the pixels of both views without padding, the left view first.
  void filter(const ocl::Buffer<cl_uchar>& images, const Map& disparity, Map& filtered, Map& variance, Views views);

 private:
  ocl::Stage stage_;
  const float least_, steps_per_px_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const float, const ocl::Buffer<cl_uchar>,
              const ocl::Buffer<float>, ocl::Buffer<float>, ocl::Buffer<float>>
      weigh_;
};

}  // namespace egosgm
