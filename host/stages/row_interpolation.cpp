// SPDX-License-Identifier: Apache-2.0
#include "host/stages/row_interpolation.h"

namespace egosgm {

RowInterpolation::RowInterpolation(ocl::Context& context, shared::ImageSize size)
    : stage_(context, "BandedSgm", "row_interpolation.cl", size), interpolate_(stage_, "interpolate_rows") {}

void RowInterpolation::interpolate(const shared::SgmParameters& parameters, StereoMaps& measured) {
  const ocl::Range right = ocl::every_pixels(stage_.enter(), stage_.size(), stage_.pixels(), /*views=*/1);
  stage_.launch(interpolate_, right, parameters, measured.disparity, measured.variance);
}

}  // namespace egosgm
