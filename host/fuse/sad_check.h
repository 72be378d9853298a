// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/image.h"
#include "host/method_options.h"
#include "host/maps.h"
#include "host/ocl/kernel.h"

namespace egosgm {

/// Drops disparities whose 3x3 windows in the two images differ by more than `max_difference` a pixel.
class SadCheck {
 public:
  SadCheck(ocl::Context& context, shared::ImageSize size, PixelType type, const SadCheckOptions& options);

  /// In place. `images`: the pixels of both views without padding, the left view first, one or two bytes each.
  void operator()(const ocl::Buffer<cl_uchar>& images, StereoMaps& maps);

 private:
  ocl::Context& context_;
  const shared::ImageSize size_;
  const float max_difference_;
  ocl::Kernel<const shared::ImageSize, const float, const ocl::Buffer<cl_uchar>, Map, Map> check_;
};

}  // namespace egosgm
