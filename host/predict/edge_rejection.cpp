// SPDX-License-Identifier: Apache-2.0
#include "host/predict/edge_rejection.h"

#include <utility>

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("EdgeRejection");
  return context.program("edge_rejection.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

EdgeRejection::EdgeRejection(ocl::Context& context, shared::ImageSize size, const EdgeRejectionOptions& options,
                             int pixels)
    : context_((context.enter("EdgeRejection"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      max_jump_px_(options.max_jump_px),
      reject_(build(context, pixels_), "reject") {}

void EdgeRejection::reject(const Map& disparity, Map& kept, Views views) {
  context_.enter("EdgeRejection");
  reject_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, max_jump_px_, disparity, kept);
}

}  // namespace egosgm
