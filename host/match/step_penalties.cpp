// SPDX-License-Identifier: Apache-2.0
#include "host/match/step_penalties.h"

#include <algorithm>

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, PixelType type, int pixels) {
  context.enter("StepPenalties");
  return context.program("step_penalties.cl",
                         ocl::Defines().set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2).set("PIXELS", pixels));
}

}  // namespace

StepPenalties::StepPenalties(ocl::Context& context, shared::ImageSize size, PixelType type,
                             const BandedSgmOptions& options, int pixels)
    : context_(context),
      size_(size),
      most_(options.p2),
      least_(std::min(options.p2_at_edges, options.p2)),
      slope_(options.p2_slope),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      penalties_(build(context, type, pixels_), "penalties") {}

void StepPenalties::compute(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uchar>& steps, Views views) {
  context_.enter("StepPenalties");
  penalties_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, most_, least_, slope_, images,
             steps);
}

}  // namespace egosgm
