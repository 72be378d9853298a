// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/frame/plan.h"
#include "host/fuse/kalman_update.h"
#include "host/fuse/prediction_check.h"
#include "host/fuse/sad_check.h"
#include "host/match/consistency_check.h"
#include "host/match/median_filter.h"
#include "host/predict/predict_room.h"
#include "host/predict/right_map.h"

namespace egosgm {

/// What fusion leaves, beside the belief.
struct Fusion {
  Map fused, smoothed;  // disparities; the latter where the median filter is on
  FlagMap doubtful;     // 1 where the measurement was taken although the prediction or its own sums speak against it

  Fusion(ocl::Context& context, shared::ImageSize size)
      : fused(context, 2 * pixel_count(size)),
        smoothed(context, 2 * pixel_count(size)),
        doubtful(context, 2 * pixel_count(size)) {}
};

/// Compares prediction and measurement, and makes one map of the two.
class FuseRoom {
 public:
  FuseRoom(ocl::Context& context, shared::ImageSize size, const MethodOptions& options, const Tuning& tuning);

  /// Builds what images of `type` need.
  void prepare(PixelType type);

  /// What prediction and measurement say of each other, by what the frame before them said.
  void compare(const Plan& plan, const Prediction& prediction, const StereoMaps& measured,
               const PredictionCheck::State& before, PredictionCheck::State& agreement);

  /// REQUIRES: the plan predicts.
  void fuse(const Plan& plan, const FrameImages& images, const Prediction& prediction, const Measurement& measured,
            const PredictionCheck::State& agreement, Fusion& fusion, StereoMaps& belief);

 private:
  const float left_right_px_;
  const OutsideView outside_;
  PredictionCheck prediction_check_;
  KalmanUpdate kalman_update_;
  std::optional<MedianFilter> median_filter_;
  std::optional<RightMap> right_map_;  // where the left view alone is tracked
  ConsistencyCheck consistency_;
  std::optional<OfEachType<SadCheck>> sad_check_;
};

}  // namespace egosgm
