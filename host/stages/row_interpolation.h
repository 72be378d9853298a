// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Fills the right view's rows between those that a frame has (see kernels/stages/row_interpolation.cl).
class RowInterpolation {
 public:
  RowInterpolation(ocl::Context& context, shared::ImageSize size, int pixels = 0);

  /// Writes these rows of both maps' right half. Every `right_row_step`-th row is there.
  void interpolate(int right_row_step, Map& disparity, Map& variance);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::ImageSize, const cl_int, Map, Map> interpolate_;
};

}  // namespace egosgm
