// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/image.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Leaves out the disparities of textureless regions that run out of the image at its top, where fewer than three
/// quarters of a region's pixels have one: they are those of outlines beside it, as beneath a sky. Pixels of the blocks
/// beside such a region that are about as bright go with it.
class TexturelessRegions {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  TexturelessRegions(ocl::Context& context, shared::ImageSize size, PixelType type, int pixels = 0);

  /// In place, in the rows that are there. `images`: of both views, as for Census.
  void leave_out(const ocl::Buffer<cl_uchar>& images, Map& disparity, Views views);

 private:
  using Labels = ocl::Buffer<cl_ushort>;
  using Counts = ocl::Buffer<cl_int>;

  ocl::Stage stage_;
  const shared::ImageSize blocks_;
  Labels labels_;  // of blocks
  Counts counts_;  // of each view's labels: pixels, and those that have a disparity
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_uchar>, Labels> find_;
  ocl::Kernel<const shared::ImageSize, const cl_int, Labels> spread_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const Map, const Labels, Counts> count_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const ocl::Buffer<cl_uchar>, const Labels, const Counts, Map>
      leave_out_;
};

}  // namespace egosgm
