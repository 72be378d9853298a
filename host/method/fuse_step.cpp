// SPDX-License-Identifier: Apache-2.0
#include "host/method/fuse_step.h"

namespace egosgm {

FuseStep::FuseStep(ocl::Context& context, shared::ImageSize size, const MethodOptions& options)
    : left_right_px_(options.consistency.update_px),
      outside_(outside_view(options.consistency)),
      textureless_regions_([&context, size](PixelType type) { return TexturelessRegions(context, size, type); }),
      kalman_update_(context, size, options.kalman_update),
      consistency_(context, size) {
  if (Evidence::is_of(options)) evidence_.emplace(context, size, options);
  if (!options.track_right) right_map_.emplace(context, size, range_of(options));
  if (options.median_filter.enabled)
    weighted_median_.emplace([&context, size, range = range_of(options)](PixelType type) {
      return WeightedMedian(context, size, type, range);
    });
  if (options.sad_check.max_difference > 0) {
    sad_check_.emplace(
        [&context, size, check = options.sad_check](PixelType type) { return SadCheck(context, size, type, check); });
  }
}

void FuseStep::prepare(PixelType type) {
  if (evidence_) textureless_regions_.prepare(type);
  if (weighted_median_) weighted_median_->prepare(type);
  if (sad_check_) sad_check_->prepare(type);
}

void FuseStep::update(const Plan& plan, const Matched& matched, const Prediction& prediction,
                      const StereoMaps& measured, Fusion& fusion, Belief& after) {
  StereoMaps& belief = after.maps;
  StereoMaps fused{fusion.fused, belief.variance};
  if (evidence_) {
    (*evidence_)(matched.codes, matched.coarse, prediction.maps.disparity, measured.disparity, fusion.evidence,
                 plan.tracked);
  }
  const KalmanUpdate::FrameEvidence of_frame{prediction.evidence, fusion.evidence, plan.repeats, plan.sees_again};
  kalman_update_.update(prediction.hidden, prediction.maps, measured, evidence_ ? &of_frame : nullptr, fused,
                        fusion.doubtful, after.evidence, plan.tracked);
  if (weighted_median_) {
    (*weighted_median_)[matched.images.type].filter(matched.images.pixels, fusion.fused, fusion.smoothed,
                                                    belief.variance, plan.tracked);
  }
  StereoMaps smoothed{weighted_median_ ? fusion.smoothed : fusion.fused, belief.variance};
  if (right_map_) {
    right_map_->complete(measured, left_right_px_, smoothed, plan.wanted.has_right(), plan.tracked.row_step);
  }
  const Views checked = plan.wanted.has_right() ? plan.with_right() : plan.tracked;
  consistency_.check(smoothed.disparity, left_right_px_, outside_, belief.disparity, checked);
  if (sad_check_) (*sad_check_)[matched.images.type].check(matched.images.pixels, belief.disparity, checked);
}

void FuseStep::publish(const Plan& plan, const FrameImages& images, const Belief& belief, Map& confirmed) {
  evidence_->publish(belief.maps.disparity, belief.evidence, confirmed, plan.published(), plan.tracked);
  textureless_regions_[images.type].leave_out(images.pixels, confirmed, plan.published());
}

}  // namespace egosgm
