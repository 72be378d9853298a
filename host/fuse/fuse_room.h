// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/frame/plan.h"
#include "host/fuse/kalman_update.h"
#include "host/fuse/right_map.h"
#include "host/fuse/sad_check.h"
#include "host/match/consistency_check.h"
#include "host/match/median_filter.h"
#include "host/predict/predict_room.h"

namespace egosgm {

/// What fusion leaves, beside the belief.
struct Fusion {
  Map fused, smoothed;  // disparities, until the room ends; the latter where the median filter is on
  FlagMap doubtful;     // 1 where the measurement was taken although the prediction or its own sums speak against it

  Fusion(ocl::Context& context, shared::ImageSize size)
      : fused(context, ocl::Scratch::kOfRoom0, 2 * pixel_count(size)),
        smoothed(context, ocl::Scratch::kOfRoom1, 2 * pixel_count(size)),
        doubtful(context, 2 * pixel_count(size)) {}
};

/// Makes one map of prediction and measurement.
class FuseRoom {
 public:
  FuseRoom(ocl::Context& context, shared::ImageSize size, const MethodOptions& options);

  /// Builds what images of `type` need.
  void prepare(PixelType type);

  /// REQUIRES: the plan predicts.
  void operator()(const Plan& plan, const FrameImages& images, const Prediction& prediction,
                  const Measurement& measured, Fusion& fusion, StereoMaps& belief);

 private:
  const float left_right_px_;
  const OutsideView outside_;
  KalmanUpdate kalman_update_;
  std::optional<MedianFilter> median_filter_;
  std::optional<RightMap> right_map_;  // where the left view alone is tracked
  ConsistencyCheck consistency_;
  std::optional<OfEachType<SadCheck>> sad_check_;
};

}  // namespace egosgm
