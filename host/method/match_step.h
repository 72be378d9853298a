// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/method/plan.h"
#include "host/stages/consistency_check.h"
#include "host/stages/matcher.h"
#include "host/stages/median_filter.h"
#include "host/stages/speckle_removal.h"

namespace egosgm {

/// Results of matching beside the measurement.
struct Matching {
  // Disparities before any was dropped, until the step ends; the latter where the median filter is on.
  Map matched, smoothed;

  Matching(ocl::Context& context, shared::ImageSize size)
      : matched(context, ocl::Scratch::kOfStep0, 2 * pixel_count(size)),
        smoothed(context, ocl::Scratch::kOfStep1, 2 * pixel_count(size)) {}
};

/// Measures disparities and variances within bands, and drops what is doubtful.
class MatchStep {
 public:
  MatchStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options, const Tuning& tuning);

  /// Builds what images of `type` need.
  void prepare(PixelType type) { matcher_.prepare(type); }

  void measure(const Plan& plan, const FrameImages& images, const SearchBands& bands, Matching& matching,
               StereoMaps& measured);

  const Matcher& matcher() const { return matcher_; }
  /// Null where nothing is dropped as a speckle.
  const SpeckleRemoval::Runs* speckle_runs(const Plan& plan) const {
    return removes_speckles(plan) ? &speckle_removal_.runs() : nullptr;
  }

 private:
  bool removes_speckles(const Plan& plan) const {
    return removes_speckles_ && !(judges_by_evidence_ && plan.predicts());
  }

  const ConsistencyCheckOptions left_right_;
  Matcher matcher_;
  std::optional<MedianFilter> median_filter_;
  ConsistencyCheck consistency_;
  SpeckleRemoval speckle_removal_;
  const bool removes_speckles_;    // of measurements that evidence does not judge
  const bool judges_by_evidence_;  // those with a prediction
};

}  // namespace egosgm
