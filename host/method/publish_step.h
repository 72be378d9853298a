// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method/plan.h"
#include "host/method/predict_step.h"
#include "host/stages/dynamic_map.h"
#include "host/stages/output_variance.h"
#include "host/stages/reasons.h"

namespace egosgm {

/// Makes what is given out and no later frame rests on.
class PublishStep {
 public:
  PublishStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options);

  /// Builds what is wanted of images of `type`.
  void prepare(PixelType type, const Wanted& wanted);

  struct Outputs {
    Map& variance;                   // [px^2] of what is given out
    ocl::Buffer<cl_uchar>& dynamic;  // marks of what contradicts a static world
    ocl::Buffer<cl_uchar>& reasons;
  };

  /// Writes what the plan wants.
  void write(const Plan& plan, const Reasons::Inputs& inputs, const Outputs& outputs);

 private:
  ocl::Context& context_;
  OutputVariance output_variance_;
  std::optional<DynamicMap> dynamic_map_;
  OfEachType<Reasons> reasons_;
};

}  // namespace egosgm
