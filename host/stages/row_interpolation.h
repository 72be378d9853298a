// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/stage.h"
#include "host/stages/maps.h"

namespace egosgm {

/// Fills the right view's rows between those that BandedSgm matched (see kernels/sgm/row_interpolation.cl).
class RowInterpolation {
 public:
  RowInterpolation(ocl::Context& context, shared::ImageSize size);

  /// Writes these rows of both maps' right half.
  void interpolate(const shared::SgmParameters& parameters, StereoMaps& measured);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::SgmParameters, Map, Map> interpolate_;
};

}  // namespace egosgm
