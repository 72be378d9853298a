// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// The vertical offset of the right image's rows: a quadratic's terms [px], the first one that of the image's middle,
/// and the number of estimates that they rest on (see kernels/stages/vertical_alignment.cl).
struct VerticalOffset {
  ocl::Buffer<float> terms;
  bool is_known = false;

  /// Starts at 0, which rests on no estimate.
  explicit VerticalOffset(ocl::Context& context);
};

/// Takes out what rectification left between the rows of the views. A left pixel (x, y) lies at (x - d, y + dy) in the
/// right image, dy a quadratic of that place; it is estimated from matched pixels (a robust step of Lucas and Kanade
/// 1981 a frame) and the right image resampled, so that rows correspond.
class VerticalAlignment {
 public:
  /// Sums of each sampled row: see the kernel.
  struct Sums {
    ocl::Buffer<cl_long> of_rows;

    Sums(ocl::Context& context, shared::ImageSize size);
  };

  /// For images of `type`. `sums` are overwritten. `row_group`: how many work-items share a row; 0: what suits the
  /// device.
  VerticalAlignment(ocl::Context& context, shared::ImageSize size, PixelType type,
                    const VerticalAlignmentOptions& options, Sums sums, int row_group = 0);

  /// Copies the left image of `images` to `aligned` and resamples the right one by `offset`.
  void resample(const FrameImages& images, const VerticalOffset& offset, FrameImages& aligned);

  /// Improves `offset`, by which `aligned` were resampled, by what is left of it between them, to `improved`. It may be
  /// `offset`. `disparity`: as measured in the left view.
  void estimate(const FrameImages& aligned, const Map& disparity, const VerticalOffset& offset,
                VerticalOffset& improved);

 private:
  ocl::Stage stage_;
  const float gain_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<float>, const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>>
      resample_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_uchar>, const Map, ocl::Buffer<cl_long>> sum_residuals_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const ocl::Buffer<cl_long>, const ocl::Buffer<float>,
              ocl::Buffer<float>>
      update_terms_;
  Sums sums_;
};

}  // namespace egosgm
