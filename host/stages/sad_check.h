// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/image.h"
#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Drops disparities whose 3x3 windows in the two images differ by more than `max_difference` a pixel.
class SadCheck {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  SadCheck(ocl::Context& context, shared::ImageSize size, PixelType type, const SadCheckOptions& options,
           int pixels = 0);

  /// In place. `images`: the pixels of both views without padding, the left view first, one or two bytes each.
  void check(const ocl::Buffer<cl_uchar>& images, Map& disparity, Views views = Views::kBoth);

 private:
  ocl::Stage stage_;
  const float max_difference_;
  ocl::Kernel<const shared::ImageSize, const float, const ocl::Buffer<cl_uchar>, Map> check_;
};

}  // namespace egosgm
