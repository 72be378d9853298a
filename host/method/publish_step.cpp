// SPDX-License-Identifier: Apache-2.0
#include "host/method/publish_step.h"

namespace egosgm {

PublishStep::PublishStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options)
    : context_(context),
      output_variance_(context, size, options.output_variance),
      reasons_([&context, size, options, repeats = Reasons::repeats(context, size)](PixelType type) {
        return Reasons(context, size, type, options, repeats);
      }) {
  if (options.temporal) dynamic_map_.emplace(context, size);
}

void PublishStep::prepare(PixelType type, const Wanted& wanted) {
  if (wanted.reasons) reasons_.prepare(type);
}

void PublishStep::write(const Plan& plan, const Reasons::Inputs& inputs, const Outputs& outputs) {
  if (plan.wanted.variance) {
    output_variance_.compute(inputs.given_out, inputs.belief, inputs.measured, outputs.variance, *plan.wanted.variance);
  }
  if (plan.wanted.reasons) reasons_[inputs.images.type].explain(inputs, outputs.reasons);
  if (!plan.wanted.dynamic) return;
  if (inputs.prediction) {
    dynamic_map_->mark(inputs.prediction->maps.disparity, inputs.measured.disparity, outputs.dynamic);
  } else {
    context_.enter("DynamicMap");
    outputs.dynamic.fill(context_, 0);
  }
}

}  // namespace egosgm
