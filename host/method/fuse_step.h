// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method/plan.h"
#include "host/method/predict_step.h"
#include "host/stages/consistency_check.h"
#include "host/stages/evidence.h"
#include "host/stages/kalman_update.h"
#include "host/stages/right_map.h"
#include "host/stages/sad_check.h"
#include "host/stages/textureless_regions.h"
#include "host/stages/weighted_median.h"

namespace egosgm {

/// Results of fusion beside the belief.
struct Fusion {
  Map fused, smoothed;  // disparities, until the step ends; the latter where the median filter is on
  FlagMap doubtful;     // 1 where the measurement was taken although the prediction speaks against it
  BlockEvidence evidence;

  Fusion(ocl::Context& context, shared::ImageSize size)
      : fused(context, ocl::Scratch::kOfStep0, 2 * pixel_count(size)),
        smoothed(context, ocl::Scratch::kOfStep1, 2 * pixel_count(size)),
        doubtful(context, 2 * pixel_count(size)),
        evidence(context, size) {}
};

/// Makes one map of prediction and measurement.
class FuseStep {
 public:
  FuseStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options);

  /// Builds what images of `type` need.
  void prepare(PixelType type);

  /// Inputs of matching: images and their codes; results of CoarseMatch, or null.
  struct Matched {
    const FrameImages& images;
    const ocl::Buffer<cl_uint>& codes;
    const CoarseView* coarse;
  };

  /// REQUIRES: the plan fuses.
  void update(const Plan& plan, const Matched& matched, const Prediction& prediction, const StereoMaps& measured,
              Fusion& fusion, Belief& belief);

  /// Writes which of a belief's disparities are published. REQUIRES: the method has evidence.
  void publish(const Plan& plan, const FrameImages& images, const Belief& belief, Map& confirmed);
  bool has_evidence() const { return evidence_.has_value(); }

 private:
  const float left_right_px_;
  const OutsideView outside_;
  std::optional<Evidence> evidence_;
  OfEachType<TexturelessRegions> textureless_regions_;
  KalmanUpdate kalman_update_;
  std::optional<OfEachType<WeightedMedian>> weighted_median_;
  std::optional<RightMap> right_map_;  // where the left view alone is tracked
  ConsistencyCheck consistency_;
  std::optional<OfEachType<SadCheck>> sad_check_;
};

}  // namespace egosgm
