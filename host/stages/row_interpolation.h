// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Fills the rows of a view between those that are there (see kernels/stages/row_interpolation.cl).
class RowInterpolation {
 public:
  RowInterpolation(ocl::Context& context, shared::ImageSize size, int pixels = 0);

  /// Writes these rows of both maps' halves of `view`.
  void interpolate(cl_int view, shared::RowSteps steps, Map& disparity, Map& variance);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::ImageSize, const cl_int, const cl_int, Map, Map> interpolate_;
};

}  // namespace egosgm
