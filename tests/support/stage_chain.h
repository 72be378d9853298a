// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "host/frame/frame_transfer.h"
#include "host/method/method.h"
#include "host/tuning_defaults.h"
#include "tests/reference/pipeline.h"
#include "tests/support/device.h"
#include "tests/support/device_maps.h"

namespace egosgm::testing {

/// Frames of the method, each looked at after every step. Maps that a later stage of the step overwrote are empty.
class StageChain {
 public:
  StageChain(const Calibration& calibration, shared::ImageSize size, const MethodOptions& options, PixelType type)
      : options_(options),
        size_(size),
        method_(context_, size, calibration, options, with_defaults({}, Device::select().info())),
        transfer_(context_, size, range_of(options)),
        before_(context_, size),
        after_(context_, size) {
    method_.prepare(type, {Output::kReason, Output::kDynamic});
  }

  reference::Frame process(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion) {
    reference::Frame frame;
    const Wanted wanted{Output::kReason, Output::kRightDisparity, Output::kRightVariance, Output::kDynamic};
    const Plan plan = plan_of(options_, before_.why_not, before_.offset.is_known, motion, wanted);
    const FrameImages& uploaded = transfer_.upload(left, right);
    method_.observer = [&](Step step) {
      look(step, plan, uploaded, frame);
      spoil_scratch();
    };
    const FrameResults results = method_.frame(plan, uploaded, before_, after_, transfer_.output());
    frame.result = download(context_, after_.maps);
    frame.evidence = after_.evidence.read(context_);
    frame.output = results.output.disparity.read(context_);
    frame.output_variance = results.output.variance.read(context_);
    std::swap(before_, after_);
    return frame;
  }

 private:
  void look(Step step, const Plan& plan, const FrameImages& uploaded, reference::Frame& frame) {
    const Workspace& work = method_.workspace();
    if (step == Step::kAlign) frame.passes.emplace_back();
    switch (step) {
      case Step::kPredict:
        if (plan.predicts()) look(work.prediction, frame);
        return;
      case Step::kAlign:
        return look_at_images(before_.offset.is_known || frame.passes.size() > 1 ? work.aligned : uploaded, frame);
      case Step::kSearch:
        if (plan.has_coarse_match) frame.passes.back().coarse = work.coarse.read(context_);
        frame.passes.back().band = {work.bands.bands.read(context_), work.bands.cell_offsets.read(context_),
                                    work.bands.row_sums.read(context_)};
        return;
      case Step::kMatch:
        return look(work.matching, plan.fuses ? work.measured : after_.maps, frame.passes.back());
      case Step::kFuse:
        if (plan.fuses) look(work.fusion, frame);
        return;
      case Step::kPublish:
        frame.dynamic = work.published.dynamic.read(context_);
        frame.reasons = work.published.reason.read(context_);
        return;
      case Step::kRefineAlignment:
        return;
    }
  }

  /// Nobody may read what a step before left there.
  void spoil_scratch() {
    for (const auto& [place, buffer] : context_.scratch()) {
      ocl::Buffer<cl_uchar>(buffer, buffer.getInfo<CL_MEM_SIZE>()).fill(context_, 0x55);
    }
  }

  void look(const Prediction& prediction, reference::Frame& frame) {
    frame.warped.disparity = prediction.warped.disparity.read(context_);
    if (options_.edge_rejection.max_jump_px > 0) {
      frame.without_edges = download_marked(context_, prediction.rejected);
    }
    if (options_.track_right && options_.consistency.checks_prediction)
      frame.filled.disparity = prediction.filled.disparity.read(context_);
    frame.predicted = download(context_, prediction.maps);
    frame.predicted.hidden = prediction.hidden.read(context_);
  }

  void look_at_images(const FrameImages& images, reference::Frame& frame) {
    const std::vector<cl_uchar> bytes = images.pixels.read(context_);
    std::vector<int>& greys = frame.passes.back().images;
    greys.resize(2 * pixel_count(size_));
    for (std::size_t i = 0; i < greys.size(); ++i) {
      greys[i] = images.type == PixelType::kU8 ? bytes[i] : bytes[2 * i] | bytes[2 * i + 1] << 8;
    }
  }

  void look(const Matching& matching, const StereoMaps& measured, reference::Pass& pass) {
    const std::vector<cl_uint> codes = method_.matcher().codes().read(context_);
    const std::vector<cl_uchar> penalties = method_.matcher().penalties().read(context_);
    pass.codes.assign(codes.begin(), codes.end());
    pass.penalties.assign(penalties.begin(), penalties.end());
    pass.matched.disparity = matching.matched.read(context_);
    if (options_.median_filter.enabled) pass.smoothed.disparity = matching.smoothed.read(context_);
    pass.measured = download(context_, measured);
  }

  void look(const Fusion& fusion, reference::Frame& frame) {
    frame.fused.disparity = fusion.fused.read(context_);
    frame.fused.doubtful = fusion.doubtful.read(context_);
    if (options_.median_filter.enabled) frame.fused_smoothed.disparity = fusion.smoothed.read(context_);
    frame.updated = download(context_, after_.maps);
  }

  const MethodOptions options_;
  const shared::ImageSize size_;
  ocl::Context& context_ = shared_context();
  Method method_;
  FrameTransfer transfer_;
  Belief before_, after_;
};

}  // namespace egosgm::testing
