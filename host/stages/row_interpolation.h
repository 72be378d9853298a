// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Fills the rows between those that are there (see kernels/stages/row_interpolation.cl).
class RowInterpolation {
 public:
  RowInterpolation(ocl::Context& context, shared::ImageSize size, int pixels = 0);

  /// Writes these rows of both maps.
  void interpolate(Map& disparity, Map& variance, Views views);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::ImageSize, const cl_int, Map, Map> interpolate_;
};

}  // namespace egosgm
