// SPDX-License-Identifier: Apache-2.0
#include "host/publish/publish_room.h"

namespace egosgm {

PublishRoom::PublishRoom(ocl::Context& context, shared::ImageSize size, const MethodOptions& options)
    : context_(context) {
  if (options.output_variance.enabled) output_variance_.emplace(context, size, options.output_variance);
  if (options.temporal) dynamic_map_.emplace(context, size, options.dynamic_map);
}

void PublishRoom::operator()(const Plan& plan, const Prediction& prediction, const StereoMaps& measured,
                             const StereoMaps& belief, Map& variance, ocl::Buffer<cl_uchar>& dynamic) {
  if (plan.wanted.variance) (*output_variance_)(belief, measured, variance, *plan.wanted.variance);
  if (!plan.wanted.dynamic) return;
  if (plan.predicts()) {
    (*dynamic_map_)(prediction.maps.disparity, measured.disparity, dynamic);
  } else {
    context_.enter("DynamicMap");
    dynamic.fill(context_, 0);
  }
}

}  // namespace egosgm
