// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "host/method/plan.h"
#include "host/method/predict_step.h"
#include "host/stages/dynamic_map.h"
#include "host/stages/output_variance.h"
#include "host/stages/reasons.h"

namespace egosgm {

/// An output on the device: a value a pixel of the left view.
struct PublishedMap {
  Output output;
  cl::Buffer values;
  std::size_t bytes;
};

/// Outputs of a frame that no later frame needs. The next frame overwrites them.
struct Published {
  ocl::Buffer<cl_uchar> reason, dynamic;

  Published(ocl::Context& context, shared::ImageSize size);
  /// Those that are wanted.
  std::vector<PublishedMap> maps(const Wanted& wanted) const;
};

/// Makes what is given out and no later frame rests on.
class PublishStep {
 public:
  PublishStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options);

  /// Builds what is wanted of images of `type`.
  void prepare(PixelType type, const Wanted& wanted);

  /// Writes what the plan wants. `variance`: [px^2] of what is given out.
  void write(const Plan& plan, const Reasons::Inputs& inputs, Map& variance, Published& published);

 private:
  ocl::Context& context_;
  OutputVariance output_variance_;
  std::optional<DynamicMap> dynamic_map_;
  OfEachType<Reasons> reasons_;
};

}  // namespace egosgm
