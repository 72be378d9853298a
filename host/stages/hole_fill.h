// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method_options.h"
#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Closes the gaps of a pixel that forward motion tears into a map: an invalid pixel between two horizontal neighbours
/// that differ by less than gamma gets their mean and the larger of their variances; then the same vertically (eqs.
/// 7-8). A pixel between two hidden ones (EGOSGM_HIDDEN) is hidden too.
class HoleFill {
 public:
  /// `pixels` of a work-item, 1 or 16; 0: by the device. Same bits.
  HoleFill(ocl::Context& context, shared::ImageSize size, const HoleFillOptions& options, int pixels = 0);

  /// Fills `views`, with a map of its own for occluded pixels. REQUIRES: the outputs are not the inputs.
  void fill(const StereoMaps& in, StereoMaps& out, FlagMap& hidden, Views views);

 private:
  ocl::Stage stage_;
  const float max_difference_px_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const ocl::Buffer<float>, const ocl::Buffer<float>,
              ocl::Buffer<float>, ocl::Buffer<float>>
      fill_rows_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const float, const ocl::Buffer<float>, const ocl::Buffer<float>,
              ocl::Buffer<float>, ocl::Buffer<float>, FlagMap>
      fill_columns_;
  StereoMaps rows_filled_;
};

}  // namespace egosgm
