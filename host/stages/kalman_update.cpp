// SPDX-License-Identifier: Apache-2.0
#include "host/stages/kalman_update.h"

#include <limits>

#include "kernels/method.h"

namespace egosgm {

KalmanUpdate::KalmanUpdate(ocl::Context& context, shared::ImageSize size, const KalmanUpdateOptions& options,
                           int pixels)
    : stage_(context, "KalmanUpdate", "kalman_update.cl", size, pixels),
      parameters_{.width = size.width,
                  .height = size.height,
                  .gate_px = options.gate_px > 0 ? options.gate_px : std::numeric_limits<float>::infinity(),
                  .min_variance_px2 = options.min_variance_px2,
                  .keep_predicted = options.keep_predicted,
                  .has_evidence = false,
                  .repeats = false,
                  .sees_again = false,
                  .row_step = 1},
      ask_neighbours_(options.ask_neighbours),
      blocks_(shared::coarse_size(size)),
      sums_(context, 2 * static_cast<std::size_t>(EGOSGM_EVIDENCE_STRIDE(size.width)) * blocks_.height),
      counts_(context, sums_.size()),
      drifts_(context, sums_.size()),
      sum_(stage_, "sum_innovations"),
      find_drift_(stage_, "find_drift"),
      update_(stage_, "update"),
      none_(context, {1, 1}) {
  drifts_.fill(stage_.enter(), 0.0f);
}

void KalmanUpdate::update(const FlagMap& hidden, const StereoMaps& predicted, const StereoMaps& measured,
                          const FrameEvidence* evidence, StereoMaps& updated, FlagMap& doubtful,
                          FlagMap& updated_evidence, Views views) {
  const BlockEvidence& blocks = evidence ? evidence->blocks : none_;
  if (ask_neighbours_) {
    const ocl::Range each = ocl::every_pixels(stage_.enter(), blocks_, stage_.pixels(), views.count);
    stage_.launch(sum_, each, stage_.size(), parameters_.gate_px, predicted.disparity, measured.disparity, sums_,
                  counts_);
    stage_.launch(find_drift_, each, stage_.size(), sums_, counts_, drifts_);
  }
  shared::KalmanParameters parameters = parameters_;
  parameters.has_evidence = evidence != nullptr;
  parameters.repeats = evidence && evidence->repeats;
  parameters.sees_again = evidence && evidence->sees_again;
  parameters.row_step = views.row_step;
  stage_.launch(update_, ocl::every_pixels(stage_.enter(), stage_.size(), stage_.pixels(), views.count), parameters,
                hidden, predicted.disparity, predicted.variance, measured.disparity, measured.variance,
                evidence ? evidence->before : hidden, blocks.evidence, blocks.found, drifts_, updated.disparity,
                updated.variance, doubtful, updated_evidence);
}

}  // namespace egosgm
