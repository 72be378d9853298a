// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "host/method/belief.h"
#include "host/method/plan.h"
#include "host/method/predict_step.h"
#include "host/stages/dynamic_map.h"
#include "host/stages/output_variance.h"
#include "host/stages/reasons.h"
#include "host/stages/row_interpolation.h"

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

/// Makes what is published and no later frame rests on.
class PublishStep {
 public:
  PublishStep(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
              const MethodOptions& options);

  /// Builds what is wanted of images of `type`.
  void prepare(PixelType type, const Wanted& wanted);

  /// Writes the variance [px^2] of the disparities that are published, if it is wanted, and fills the rows that are
  /// left out, in these and in the maps that wanted outputs are made of.
  void complete(const Plan& plan, Prediction& prediction, StereoMaps& belief, StereoMaps& measured, StereoMaps& result);
  /// Writes what else the plan wants. `before`: the belief of the frame before. `after`: this frame's; it keeps the
  /// left image for the next frame's `dynamic` where this frame's is wanted.
  void write(const Plan& plan, const Reasons::Inputs& inputs, const Belief& before, Belief& after,
             Published& published);

 private:
  ocl::Context& context_;
  RowInterpolation row_interpolation_;
  OutputVariance output_variance_;
  std::function<DynamicMap()> build_dynamic_map_;  // null: frames have no prediction
  std::optional<DynamicMap> dynamic_map_;          // once it was wanted
  OfEachType<Reasons> reasons_;
};

}  // namespace egosgm
