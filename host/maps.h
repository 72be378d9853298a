// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/image.h"
#include "host/ocl/buffer.h"
#include "kernels/shared.h"

namespace egosgm {

inline std::size_t pixel_count(shared::ImageSize size) { return static_cast<std::size_t>(size.width) * size.height; }

/// Both views' pixels on the device, the left view first, without gaps; 1 or 2 bytes each.
struct FrameImages {
  ocl::Buffer<cl_uchar> pixels;
  PixelType type = PixelType::kU8;
};

/// Disparity [px] and variance [px^2] of both views, the left one first. Variance is 0 where the disparity is invalid.
struct StereoMaps {
  ocl::Buffer<float> disparity, variance;

  StereoMaps(ocl::Context& context, shared::ImageSize size)
      : disparity(context, 2 * pixel_count(size)), variance(context, 2 * pixel_count(size)) {}
};

/// How the right view's disparities come about: matched in bands of their own; read off the sums of the left view's
/// match, which is half of the work, whole ones; or not at all, and what was there stays.
enum class RightView { kMatched, kReadOff, kNone };

}  // namespace egosgm
