// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/frame/plan.h"
#include "host/match/consistency_check.h"
#include "host/predict/edge_rejection.h"
#include "host/predict/forward_warp.h"
#include "host/predict/hole_fill.h"
#include "host/predict/right_map.h"

namespace egosgm {

/// What the last frame's maps say of this one. Where the left view alone is tracked, the right one is there to check it
/// by: its disparities but for the last check, and no variances.
struct Prediction {
  StereoMaps warped;     // before anything was dropped; of what EdgeRejection dropped, the variances are gone
  Map rejected, filled;  // disparities after those stages
  StereoMaps maps;
  // Where a surface that came nearer than the range hides what is behind, before and after holes were filled.
  FlagMap warped_hidden, hidden;

  Prediction(ocl::Context& context, shared::ImageSize size)
      : warped(context, size),
        rejected(context, 2 * pixel_count(size)),
        filled(context, 2 * pixel_count(size)),
        maps(context, size),
        warped_hidden(context, 2 * pixel_count(size)),
        hidden(context, 2 * pixel_count(size)) {
    // A view that is not tracked stays so.
    for (FlagMap* map : {&warped_hidden, &hidden}) map->write(context, std::vector<cl_uchar>(map->size()));
  }
};

/// Moves the maps of the last frame into this one, and drops what is doubtful.
class PredictRoom {
 public:
  PredictRoom(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
              const MethodOptions& options, const Tuning& tuning);

  /// REQUIRES: the plan has a motion.
  void operator()(const Plan& plan, const StereoMaps& belief, Prediction& prediction);

 private:
  const float left_right_px_;
  const OutsideView outside_;
  ForwardWarp forward_warp_;
  std::optional<RightMap> right_map_;  // where the left view alone is tracked
  EdgeRejection edge_rejection_;
  HoleFill hole_fill_;
  ConsistencyCheck consistency_;
};

}  // namespace egosgm
