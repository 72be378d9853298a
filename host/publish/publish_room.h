// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/publish/dynamic_map.h"
#include "host/frame/plan.h"
#include "host/publish/output_variance.h"
#include "host/predict/predict_room.h"

namespace egosgm {

/// Makes what is given out and no later frame rests on.
class PublishRoom {
 public:
  PublishRoom(ocl::Context& context, shared::ImageSize size, const MethodOptions& options);

  /// Writes the variance [px^2] of the `belief` and the marks of what contradicts a static world, as the plan wants
  /// them.
  void operator()(const Plan& plan, const Prediction& prediction, const StereoMaps& measured, const StereoMaps& belief,
                  Map& variance, ocl::Buffer<cl_uchar>& dynamic);

 private:
  ocl::Context& context_;
  std::optional<OutputVariance> output_variance_;
  std::optional<DynamicMap> dynamic_map_;
};

}  // namespace egosgm
