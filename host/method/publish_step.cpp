// SPDX-License-Identifier: Apache-2.0
#include "host/method/publish_step.h"

namespace egosgm {

Published::Published(ocl::Context& context, shared::ImageSize size)
    : reason(context, pixel_count(size)), dynamic(context, pixel_count(size)) {}

std::vector<PublishedMap> Published::maps(const Wanted& wanted) const {
  std::vector<PublishedMap> maps;
  const auto add = [&]<typename T>(Output output, const ocl::Buffer<T>& map) {
    if (wanted.has(output)) maps.push_back({output, map.get(), map.size() * sizeof(T)});
  };
  add(Output::kReason, reason);
  add(Output::kDynamic, dynamic);
  return maps;
}

PublishStep::PublishStep(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
                         const MethodOptions& options)
    : context_(context),
      row_interpolation_(context, size),
      output_variance_(context, size, options.output_variance),
      reasons_([&context, size, options, repeats = Reasons::repeats(context, size)](PixelType type) {
        return Reasons(context, size, type, options, repeats);
      }) {
  if (!options.temporal) return;
  build_dynamic_map_ = [&context, size, calibration, levels = DynamicMap::levels(context, size)] {
    return DynamicMap(context, size, calibration, levels);
  };
}

void PublishStep::prepare(PixelType type, const Wanted& wanted) {
  if (wanted.has(Output::kReason)) reasons_.prepare(type);
  if (wanted.has(Output::kDynamic) && build_dynamic_map_ && !dynamic_map_) dynamic_map_.emplace(build_dynamic_map_());
}

void PublishStep::complete(const Plan& plan, Prediction& prediction, StereoMaps& belief, StereoMaps& measured,
                           StereoMaps& result) {
  const Wanted& wanted = plan.wanted;
  const Views views = plan.published();
  const bool has_variance = wanted.has(Output::kVariance) || wanted.has(Output::kRightVariance);
  if (has_variance) {
    output_variance_.compute(result.disparity, belief, measured, result.variance,
                             {wanted.has(Output::kRightVariance) ? 2 : 1, views.row_step});
  }
  row_interpolation_.interpolate(result.disparity, result.variance, views);
  if (wanted.has(Output::kDynamic)) row_interpolation_.interpolate(belief.disparity, belief.variance, views);
  if (wanted.has(Output::kMeasured) || wanted.has(Output::kMeasuredVariance)) {
    row_interpolation_.interpolate(measured.disparity, measured.variance, views);
  }
  if (plan.predicts() && (wanted.has(Output::kPredicted) || wanted.has(Output::kPredictedVariance))) {
    row_interpolation_.interpolate(prediction.maps.disparity, prediction.maps.variance, {1, views.row_step});
  }
}

void PublishStep::write(const Plan& plan, const Reasons::Inputs& inputs, const Belief& before, Belief& after,
                        Published& published) {
  const Wanted& wanted = plan.wanted;
  if (wanted.has(Output::kReason))
    reasons_[inputs.match.images.type].explain(inputs, plan.tracked.row_step, published.reason);
  after.has_halved = wanted.has(Output::kDynamic) && dynamic_map_;
  if (after.has_halved) dynamic_map_->keep(inputs.match.images, after.halved);
  if (!wanted.has(Output::kDynamic)) return;
  if (before.has_halved && plan.predicts()) {
    dynamic_map_->mark({before.halved, before.maps.disparity}, {after.halved, inputs.fused.output}, *plan.motion,
                       published.dynamic);
  } else {
    context_.enter("DynamicMap");
    published.dynamic.fill(context_, 0);
  }
}

}  // namespace egosgm
