// SPDX-License-Identifier: Apache-2.0
#include "host/stages/kalman_update.h"

#include <limits>

namespace egosgm {

KalmanUpdate::KalmanUpdate(ocl::Context& context, shared::ImageSize size, const KalmanUpdateOptions& options,
                           int pixels)
    : stage_(context, "KalmanUpdate", "kalman_update.cl", size, pixels),
      has_gate_(options.gate_px > 0),
      gate_px_(options.gate_px > 0 ? options.gate_px : std::numeric_limits<float>::infinity()),
      keep_predicted_(options.keep_predicted),
      ask_neighbours_(options.ask_neighbours),
      min_variance_px2_(options.min_variance_px2),
      update_(stage_, "update"),
      none_(context, {1, 1}) {}

void KalmanUpdate::update(const FlagMap& hidden, const StereoMaps& predicted, const Measurement& measured,
                          const FrameEvidence* evidence, StereoMaps& updated, FlagMap& doubtful,
                          FlagMap& updated_evidence, Views views) {
  const BlockEvidence& blocks = evidence ? evidence->blocks : none_;
  stage_.launch_pixels(update_, count(views), has_gate_, gate_px_, keep_predicted_, ask_neighbours_, min_variance_px2_,
                       hidden, predicted.disparity, predicted.variance, measured.disparity, measured.variance,
                       measured.doubtful, evidence != nullptr, evidence && evidence->repeats,
                       evidence ? evidence->before : hidden, blocks.evidence, blocks.found, updated.disparity,
                       updated.variance, doubtful, updated_evidence);
}

}  // namespace egosgm
