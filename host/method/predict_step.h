// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method/belief.h"
#include "host/method/plan.h"
#include "host/stages/consistency_check.h"
#include "host/stages/edge_rejection.h"
#include "host/stages/forward_warp.h"
#include "host/stages/hole_fill.h"

namespace egosgm {

/// Moves the maps of the last frame into this one, and drops what is doubtful.
class PredictStep {
 public:
  PredictStep(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
              const MethodOptions& options, const Tuning& tuning);

  /// REQUIRES: the plan has a motion.
  void predict(const Plan& plan, const Belief& belief, Prediction& prediction);

 private:
  const float left_right_px_;
  const OutsideView outside_;
  const bool checks_;  // left against right
  ForwardWarp forward_warp_;
  std::optional<EdgeRejection> edge_rejection_;
  HoleFill hole_fill_;
  ConsistencyCheck consistency_;
};

}  // namespace egosgm
