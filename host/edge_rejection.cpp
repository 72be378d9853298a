// SPDX-License-Identifier: Apache-2.0
#include "host/edge_rejection.h"

#include <limits>

namespace egosgm {
namespace {

const cl::Program& build(ocl::Context& context) {
  context.enter("EdgeRejection");
  return context.program("edge_rejection.cl", {});
}

}  // namespace

EdgeRejection::EdgeRejection(ocl::Context& context, shared::ImageSize size, const EdgeRejectionOptions& options)
    : context_(context),
      size_(size),
      max_jump_px_(options.max_jump_px > 0 ? options.max_jump_px : std::numeric_limits<float>::max()),
      reject_(build(context), "reject") {}

void EdgeRejection::operator()(const StereoMaps& in, StereoMaps& out) {
  context_.enter("EdgeRejection");
  reject_(context_, ocl::every_pixel(context_, size_), size_, max_jump_px_, in.disparity, in.variance, out.disparity,
          out.variance);
}

}  // namespace egosgm
