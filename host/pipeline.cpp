// SPDX-License-Identifier: Apache-2.0
// The table of contents: a frame, a line a stage.
#include "egosgm/pipeline.h"

#include <chrono>

#include "egosgm/error.h"
#include "egosgm/programs.h"
#include "host/banded_sgm.h"
#include "host/census.h"
#include "host/consistency_check.h"
#include "host/edge_rejection.h"
#include "host/forward_warp.h"
#include "host/frame_transfer.h"
#include "host/hole_fill.h"
#include "host/kalman_update.h"
#include "host/median_filter.h"
#include "host/ocl/device_handle.h"
#include "host/ocl/errors.h"
#include "host/sad_check.h"
#include "host/search_band.h"
#include "host/speckle_removal.h"
#include "host/step_penalties.h"
#include "host/vertical_alignment.h"

namespace egosgm {
namespace {

/// The stages that depend on the type of a grey value.
struct PixelStages {
  Census census;
  StepPenalties step_penalties;
  SadCheck sad_check;

  PixelStages(ocl::Context& context, shared::ImageSize size, PixelType type, const PipelineOptions& options,
              int code_padding)
      : census(context, size, type, options.banded_sgm.cost, code_padding),
        step_penalties(context, size, type, options.banded_sgm),
        sad_check(context, size, type, options.sad_check) {}
};

shared::DisparityRange range_of(const PipelineOptions& options) { return {options.min_disparity, options.disparities}; }

}  // namespace

struct Pipeline::Impl {
  const PipelineOptions options;
  const Device device;
  const shared::ImageSize size;
  ocl::Context context;

  ForwardWarp forward_warp;
  EdgeRejection edge_rejection;
  HoleFill hole_fill;
  ConsistencyCheck consistency;
  VerticalAlignment vertical_alignment;
  SearchBand search_band;
  PixelStages stages_u8, stages_u16;
  BandedSgm banded_sgm;
  MedianFilter median_filter;
  SpeckleRemoval speckle_removal;
  KalmanUpdate kalman_update;
  FrameTransfer transfer;

  ocl::Buffer<cl_uint> codes;
  ocl::Buffer<cl_uchar> penalties;
  StereoMaps predicted, measured, scratch, updated, belief;
  bool has_belief = false;
  const char* no_belief_reason = "first frame";

  Impl(const Calibration& calibration, shared::ImageSize image_size, const PipelineOptions& chosen,
       const Device& chosen_device)
      : options(chosen),
        device(chosen_device),
        size(image_size),
        context(device.handle().device, device.handle().programs),
        forward_warp(context, size, calibration, options.forward_warp, range_of(options)),
        edge_rejection(context, size, options.edge_rejection),
        hole_fill(context, size, options.hole_fill),
        consistency(context, size),
        vertical_alignment(context, size, options.vertical_alignment),
        search_band(context, size, range_of(options), options.search_band),
        stages_u8(context, size, PixelType::kU8, options, BandedSgm::code_padding(range_of(options))),
        stages_u16(context, size, PixelType::kU16, options, BandedSgm::code_padding(range_of(options))),
        banded_sgm(context, size, range_of(options), options.banded_sgm),
        median_filter(context, size, options.median_filter),
        speckle_removal(context, size, options.speckle_removal),
        kalman_update(context, size, options.kalman_update),
        transfer(context, size, range_of(options)),
        codes(context, Census::words(options.banded_sgm.cost, size, BandedSgm::code_padding(range_of(options)))),
        penalties(context, StepPenalties::plane_count(size)),
        predicted(context, size),
        measured(context, size),
        scratch(context, size),
        updated(context, size),
        belief(context, size) {}

  /// Why this frame has no prediction, or null.
  const char* full_range_reason(const std::optional<Motion>& motion) const {
    if (!options.temporal) return "not temporal";
    if (!has_belief) return no_belief_reason;
    return motion ? nullptr : "no motion";
  }

  void predict(const Motion& motion) {
    forward_warp(belief, motion, scratch);
    edge_rejection(scratch, predicted);
    hole_fill(predicted, scratch);
    consistency(scratch, options.consistency.prediction_px, OutsideView::kKeep, predicted);
  }

  void match_aligned(const FrameImages& images, bool full_range) {
    if (full_range) {
      search_band.full_range();
    } else if (options.search == SearchMode::kFull) {
      search_band.full_range(predicted);
    } else {
      search_band(predicted);
    }
    stages_of(images.type).census(images.pixels, codes);
    stages_of(images.type).step_penalties(images.pixels, penalties);
    banded_sgm(codes, penalties, search_band, scratch);
    median_filter(scratch, Holes::kLeave);
    consistency(scratch, options.consistency.measurement_px, OutsideView::kDrop, measured);
    speckle_removal(measured);
  }

  /// Returns the images that were matched.
  const FrameImages& match(const FrameImages& uploaded, bool full_range) {
    const FrameImages* images = &vertical_alignment.align(uploaded);
    match_aligned(*images, full_range);
    if (vertical_alignment.is_unknown()) {
      vertical_alignment.estimate(*images, measured);
      images = &vertical_alignment.realign(uploaded);
      match_aligned(*images, full_range);
    }
    vertical_alignment.estimate(*images, measured);
    return *images;
  }

  void update(const FrameImages& images) {
    kalman_update(predicted, measured, updated);
    median_filter(updated, Holes::kFill);
    consistency(updated, options.consistency.update_px, OutsideView::kKeep, scratch);
    stages_of(images.type).sad_check(images.pixels, scratch, updated);
  }

  FrameReport process(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
                      const FrameOutputs& outputs) {
    const auto start = std::chrono::steady_clock::now();
    const ocl::Drain drain{context};
    const char* reason = full_range_reason(motion);
    const FrameImages& uploaded = transfer.upload(left, right);
    if (!reason) predict(*motion);
    const FrameImages& images = match(uploaded, reason);
    if (!reason) update(images);

    StereoMaps& result = reason ? measured : updated;
    FrameReport report = transfer.download(result, reason ? nullptr : &predicted, measured, search_band,
                                           vertical_alignment.offset_px(), outputs);
    report.full_range = reason || options.search == SearchMode::kFull;
    report.full_range_reason = reason ? reason : options.search == SearchMode::kFull ? "search is full" : "";
    std::swap(belief, result);  // only now: a frame that failed has changed nothing
    has_belief = options.temporal;
    vertical_alignment.commit();
    report.total_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    return report;
  }

  PixelStages& stages_of(PixelType type) { return type == PixelType::kU8 ? stages_u8 : stages_u16; }
};

Pipeline::Pipeline(const Calibration& calibration, int width, int height, const PipelineOptions& options,
                   const Device& device) {
  calibration.validate();
  options.validate();
  FrameTransfer::validate_size(width, height);
  impl_ = ocl::translated("Pipeline", [&] {
    return std::make_unique<Impl>(calibration, shared::ImageSize{width, height}, options, device);
  });
}

Pipeline::~Pipeline() = default;
Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;

FrameReport Pipeline::process(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
                              const FrameOutputs& outputs) {
  impl_->transfer.validate(left, right, outputs);
  if (motion) motion->validate();
  return ocl::translated(impl_->context, [&] { return impl_->process(left, right, motion, outputs); });
}

void Pipeline::reset() {
  impl_->has_belief = false;
  impl_->no_belief_reason = "reset";
  impl_->vertical_alignment.reset();
}

const PipelineOptions& Pipeline::options() const { return impl_->options; }
const Device& Pipeline::device() const { return impl_->device; }
std::uint64_t Pipeline::device_memory_bytes() const { return impl_->context.allocated_bytes(); }

std::vector<ProgramFile> compile_programs(const Device& device, const PipelineOptions& options) {
  options.validate();
  return ocl::translated("compile", [&] {
    // Of the least size: no define depends on it.
    const Calibration any{.fx = 1, .fy = 1, .cx = 0, .cy = 0, .baseline_m = 1};
    const Pipeline::Impl pipeline(any, shared::ImageSize{1, 1}, options, device);
    return ocl::files_of(device.handle().device, pipeline.context.programs());
  });
}

}  // namespace egosgm
