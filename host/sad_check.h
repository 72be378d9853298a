// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/image.h"
#include "egosgm/options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// Drops disparities whose 3x3 windows in the two images differ by more than `max_difference` a pixel.
class SadCheck {
 public:
  SadCheck(ocl::Context& context, shared::ImageSize size, PixelType type, const SadCheckOptions& options);

  /// `images`: the pixels of both views without padding, the left view first, one or two bytes each.
  /// `in` and `out` may be the same maps. With the check off, nothing is launched: `in` and `out` change places.
  void operator()(const ocl::Buffer<cl_uchar>& images, StereoMaps& in, StereoMaps& out);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const SadCheckOptions options_;
  ocl::Kernel<const shared::ImageSize, const float, const ocl::Buffer<cl_uchar>, const ocl::Buffer<float>,
              const ocl::Buffer<float>, ocl::Buffer<float>, ocl::Buffer<float>>
      check_;
};

}  // namespace egosgm
