// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/frame/belief.h"
#include "host/frame/plan.h"
#include "host/match/consistency_check.h"
#include "host/predict/edge_rejection.h"
#include "host/predict/forward_warp.h"
#include "host/predict/hole_fill.h"

namespace egosgm {

/// The prediction of this frame from the last frame's maps, of the tracked views.
struct Prediction {
  StereoMaps warped;    // before anything was dropped
  StereoMaps rejected;  // of these, what EdgeRejection keeps; until the room ends
  StereoMaps maps;
  StereoMaps filled;  // before they were checked, where they are; until the room ends
  FlagMap evidence;   // of what was warped
  FlagMap hidden;     // where a surface that came nearer than the range hides what is behind it

  Prediction(ocl::Context& context, shared::ImageSize size)
      : warped(context, size),
        rejected(Map(context, ocl::Scratch::kOfRoom0, 2 * pixel_count(size)), warped.variance),
        maps(context, size),
        filled(Map(context, ocl::Scratch::kOfRoom1, 2 * pixel_count(size)), maps.variance),
        evidence(context, 2 * pixel_count(size)),
        hidden(context, 2 * pixel_count(size)) {}
};

/// Moves the maps of the last frame into this one, and drops what is doubtful.
class PredictRoom {
 public:
  PredictRoom(ocl::Context& context, shared::ImageSize size, const Calibration& calibration,
              const MethodOptions& options, const Tuning& tuning);

  /// REQUIRES: the plan has a motion.
  void predict(const Plan& plan, const Belief& belief, Prediction& prediction);

 private:
  const float left_right_px_;
  const OutsideView outside_;
  ForwardWarp forward_warp_;
  std::optional<EdgeRejection> edge_rejection_;
  HoleFill hole_fill_;
  ConsistencyCheck consistency_;  // of both views, where they are tracked
};

}  // namespace egosgm
