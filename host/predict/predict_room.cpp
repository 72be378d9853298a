// SPDX-License-Identifier: Apache-2.0
#include "host/predict/predict_room.h"

namespace egosgm {

PredictRoom::PredictRoom(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
                         const MethodOptions& options, const Tuning& tuning)
    : left_right_px_(options.consistency.prediction_px),
      outside_(outside_view(options.consistency)),
      forward_warp_(context, size, calibration, options.forward_warp, range_of(options), 0, tuning.warp_band_rows),
      edge_rejection_(context, size, options.edge_rejection),
      hole_fill_(context, size, options.hole_fill),
      consistency_(context, size) {
  if (!options.track_right) right_map_.emplace(context, size, range_of(options));
}

void PredictRoom::operator()(const Plan& plan, const StereoMaps& belief, Prediction& prediction) {
  auto& [warped, rejected, filled, maps, warped_hidden, hidden] = prediction;
  forward_warp_(belief, *plan.motion, warped, warped_hidden, plan.tracked);
  if (plan.tracked == Views::kLeft) (*right_map_)(left_right_px_, warped, /*makes_variance=*/false);
  edge_rejection_(warped.disparity, rejected, warped.variance);
  StereoMaps holes_filled{filled, maps.variance};
  hole_fill_({rejected, warped.variance}, warped_hidden, holes_filled, hidden, plan.tracked);
  consistency_(filled, left_right_px_, outside_, maps.disparity, maps.variance, plan.tracked);
}

}  // namespace egosgm
