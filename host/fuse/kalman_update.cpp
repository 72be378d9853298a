// SPDX-License-Identifier: Apache-2.0
#include "host/fuse/kalman_update.h"

#include <limits>

namespace egosgm {
namespace {

ocl::Program& build(ocl::Context& context, int pixels) {
  context.enter("KalmanUpdate");
  return context.program("kalman_update.cl", ocl::Defines().set("PIXELS", pixels));
}

}  // namespace

KalmanUpdate::KalmanUpdate(ocl::Context& context, shared::ImageSize size, const KalmanUpdateOptions& options,
                           int pixels)
    : context_((context.enter("KalmanUpdate"), context)),
      size_(size),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      has_gate_(options.gate_px > 0),
      gate_px_(options.gate_px > 0 ? options.gate_px : std::numeric_limits<float>::infinity()),
      keep_predicted_(options.keep_predicted),
      ask_neighbours_(options.ask_neighbours),
      min_variance_px2_(options.min_variance_px2),
      update_(build(context, pixels_), "update"),
      none_(context, {1, 1}) {}

void KalmanUpdate::update(const FlagMap& hidden, const StereoMaps& predicted, const Measurement& measured,
                          const FrameEvidence* evidence, StereoMaps& updated, FlagMap& doubtful,
                          FlagMap& updated_evidence, Views views) {
  const BlockEvidence& blocks = evidence ? evidence->blocks : none_;
  context_.enter("KalmanUpdate");
  update_(context_, ocl::every_pixels(context_, size_, pixels_, count(views)), size_, has_gate_, gate_px_,
          keep_predicted_, ask_neighbours_, min_variance_px2_, hidden, predicted.disparity, predicted.variance,
          measured.disparity, measured.variance, measured.doubtful, evidence != nullptr, evidence && evidence->repeats,
          evidence ? evidence->before : hidden, blocks.evidence, blocks.found, updated.disparity, updated.variance,
          doubtful, updated_evidence);
}

}  // namespace egosgm
