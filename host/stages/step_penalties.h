// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// The penalty of a disparity jump between neighbouring pixels, by the grey values between them (see
/// kernels/stages/step_penalties.cl).
class StepPenalties {
 public:
  StepPenalties(ocl::Context& context, shared::ImageSize size, PixelType type, const BandedSgmOptions& options,
                int pixels = 0);

  /// `images`: both views' pixels. `steps`: `bytes(size)` penalties, a byte each. `views`: 1 writes those of the left
  /// view only.
  void compute(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uchar>& steps, Views views);

  static constexpr int kStepsAPixel = 4;
  static std::size_t bytes(shared::ImageSize size) { return kStepsAPixel * 2 * pixel_count(size); }

 private:
  ocl::Stage stage_;
  const cl_int most_, least_, slope_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, const cl_int, const cl_int,
              const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>>
      penalties_;
};

}  // namespace egosgm
