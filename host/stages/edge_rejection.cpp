// SPDX-License-Identifier: Apache-2.0
#include "host/stages/edge_rejection.h"

namespace egosgm {

EdgeRejection::EdgeRejection(ocl::Context& context, shared::ImageSize size, const EdgeRejectionOptions& options,
                             int pixels)
    : stage_(context, "EdgeRejection", "edge_rejection.cl", size, pixels),
      max_jump_px_(options.max_jump_px),
      reject_(stage_, "reject") {}

void EdgeRejection::reject(const Map& disparity, Map& kept, Views views) {
  stage_.launch_pixels(reject_, views.count, views.row_step, max_jump_px_, disparity, kept);
}

}  // namespace egosgm
