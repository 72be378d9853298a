// SPDX-License-Identifier: Apache-2.0
#include "host/method/predict_step.h"

namespace egosgm {

PredictStep::PredictStep(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
                         const MethodOptions& options, const Tuning& tuning)
    : left_right_px_(options.consistency.update_px),
      outside_(outside_view(options.consistency)),
      checks_(options.consistency.checks_prediction && options.track_right),
      forward_warp_(context, size, calibration, options.forward_warp, range_of(options), 0, tuning.warp_band_rows),
      hole_fill_(context, size, options.hole_fill),
      consistency_(context, size) {
  if (options.edge_rejection.max_jump_px > 0) edge_rejection_.emplace(context, size, options.edge_rejection);
}

void PredictStep::predict(const Plan& plan, const Belief& belief, Prediction& prediction) {
  auto& [warped, rejected, maps, filled, evidence, hidden] = prediction;
  forward_warp_.warp(belief.maps, belief.evidence, *plan.motion, warped, evidence, plan.tracked);
  if (edge_rejection_) edge_rejection_->reject(warped.disparity, rejected.disparity, plan.tracked);
  hole_fill_.fill(edge_rejection_ ? rejected : warped, checks_ ? filled : maps, hidden, plan.tracked);
  if (checks_) consistency_.check(filled.disparity, left_right_px_, outside_, maps.disparity, plan.tracked);
}

}  // namespace egosgm
