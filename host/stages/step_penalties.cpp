// SPDX-License-Identifier: Apache-2.0
#include "host/stages/step_penalties.h"

#include <algorithm>

namespace egosgm {

StepPenalties::StepPenalties(ocl::Context& context, shared::ImageSize size, PixelType type,
                             const BandedSgmOptions& options, int pixels)
    : stage_(context, "StepPenalties", "step_penalties.cl", size, pixels, pixel_define(type)),
      most_(options.p2),
      least_(std::min(options.p2_at_edges, options.p2)),
      slope_(options.p2_slope),
      penalties_(stage_, "penalties") {}

void StepPenalties::compute(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uchar>& steps, Views views) {
  stage_.launch_pixels(penalties_, views.count, views.row_step, most_, least_, slope_, images, steps);
}

}  // namespace egosgm
