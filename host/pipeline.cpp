// SPDX-License-Identifier: Apache-2.0
// The table of contents: a frame, a line a stage.
#include "egosgm/pipeline.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "egosgm/error.h"
#include "egosgm/opencl.h"
#include "egosgm/programs.h"
#include "host/banded_sgm.h"
#include "host/census.h"
#include "host/coarse_match.h"
#include "host/consistency_check.h"
#include "host/dynamic_map.h"
#include "host/edge_rejection.h"
#include "host/forward_warp.h"
#include "host/frame_transfer.h"
#include "host/hole_fill.h"
#include "host/kalman_update.h"
#include "host/median_filter.h"
#include "host/ocl/device_handle.h"
#include "host/ocl/errors.h"
#include "host/ocl/svm.h"
#include "host/output_variance.h"
#include "host/prediction_check.h"
#include "host/right_map.h"
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

std::optional<BandedSgmPaths::Group> path_group(const Tuning& tuning) {
  if (tuning.path_lanes == 0) return {};
  return BandedSgmPaths::Group{tuning.path_lanes, tuning.path_lines};
}

ocl::Context context_on(const Device::Handle& device) {
  return device.queue() ? ocl::Context(device.queue, device.programs) : ocl::Context(device.device, device.programs);
}

using Clock = std::chrono::steady_clock;

/// What a frame leaves to the next one.
struct Memory {
  const StereoMaps* belief = nullptr;
  const char* no_belief_reason = "first frame";
  VerticalAlignment::State alignment = 0;
};

/// What a frame makes that no later frame rests on.
struct Wanted {
  int variance_views;            // that need the variance which is given out, the left one first
  ocl::Buffer<float>* variance;  // its place
  bool dynamic;
};

struct FrameUnderWay {
  FrameTransfer* transfer;
  Memory before;  // to go back to if it fails
  const StereoMaps* result;
  FrameReport report;
  std::vector<ocl::Command> commands;
  Clock::time_point start;
};

}  // namespace

struct Pipeline::Impl {
  const PipelineOptions options;
  const Device device;
  const shared::ImageSize size;
  const Tuning tuning;
  ocl::Context context;

  ForwardWarp forward_warp;
  EdgeRejection edge_rejection;
  HoleFill hole_fill;
  ConsistencyCheck consistency;
  VerticalAlignment vertical_alignment;
  std::optional<CoarseMatch> coarse_match;
  SearchBand search_band;
  PixelStages stages_u8, stages_u16;
  BandedSgm banded_sgm;
  MedianFilter median_filter;
  SpeckleRemoval speckle_removal;
  KalmanUpdate kalman_update;
  PredictionCheck prediction_check;
  RightMap right_map;
  OutputVariance output_variance;
  DynamicMap dynamic_map;
  std::array<FrameTransfer, kMaxUnderWay> transfers;

  ocl::Buffer<cl_uint> codes;
  ocl::Buffer<cl_uchar> penalties;
  StereoMaps predicted, scratch;
  std::array<StereoMaps, 4> pool;  // the belief, the one to go back to, and what a frame takes of the rest:
  StereoMaps *measured = nullptr, *updated = nullptr;
  std::array<PredictionCheck::State, 4> prediction_states;  // of each in the pool, as a belief
  Memory memory;
  std::vector<FrameUnderWay> under_way;    // the oldest first
  Clock::time_point collected;             // the last one before them
  std::vector<ocl::Command> device_frame;  // of the last `enqueue`
  bool records_commands = false;

  Impl(const Calibration& calibration, shared::ImageSize image_size, const PipelineOptions& chosen,
       const Device& chosen_device)
      : options(chosen),
        device(chosen_device),
        size(image_size),
        tuning(with_defaults(device.handle().tuning, device.info())),
        context(context_on(device.handle())),
        forward_warp(context, size, calibration, options.forward_warp, range_of(options), 0, tuning.warp_band_rows),
        edge_rejection(context, size, options.edge_rejection),
        hole_fill(context, size, options.hole_fill),
        consistency(context, size),
        vertical_alignment(context, size, options.vertical_alignment, tuning.row_group),
        search_band(context, size, range_of(options), options.search_band, tuning.row_group),
        stages_u8(context, size, PixelType::kU8, options, BandedSgm::code_padding(range_of(options))),
        stages_u16(context, size, PixelType::kU16, options, BandedSgm::code_padding(range_of(options))),
        banded_sgm(context, size, range_of(options), options.banded_sgm, path_group(tuning),
                   {tuning.tile_width, tuning.tile_height, tuning.block_lanes}),
        median_filter(context, size, options.median_filter),
        speckle_removal(context, size, options.speckle_removal, tuning.speckle_strip_rows, tuning.row_group),
        kalman_update(context, size, options.kalman_update),
        prediction_check(context, size, options.prediction_check, tuning.row_group),
        right_map(context, size, range_of(options)),
        output_variance(context, size, options.output_variance),
        dynamic_map(context, size, options.dynamic_map),
        transfers{{{context, size, range_of(options)}, {context, size, range_of(options)}}},
        codes(context, Census::words(options.banded_sgm.cost, size, BandedSgm::code_padding(range_of(options)))),
        penalties(context, StepPenalties::count(size)),
        predicted(context, size),
        scratch(context, size),
        pool{{{context, size}, {context, size}, {context, size}, {context, size}}},
        prediction_states{{{context, 1}, {context, 1}, {context, 1}, {context, 1}}} {
    if (options.coarse_match.enabled && options.temporal && options.search == SearchMode::kBand) {
      coarse_match.emplace(context, size, options);
    }
  }

  ~Impl() { context.drain(); }

  /// Why this frame has no prediction, or null.
  const char* full_range_reason(const std::optional<Motion>& motion) const {
    if (!options.temporal) return "not temporal";
    if (!memory.belief) return memory.no_belief_reason;
    return motion ? nullptr : "no motion";
  }

  void predict(const Motion& motion) {
    forward_warp(*memory.belief, motion, *updated, tracked_views());
    if (!options.track_right) right_map(options.consistency.prediction_px, *updated);
    edge_rejection(*updated, predicted);
    hole_fill(predicted, scratch);
    consistency(scratch, options.consistency.prediction_px, OutsideView::kKeep, predicted);
  }

  int tracked_views() const { return options.track_right ? 2 : 1; }

  void match_aligned(const FrameImages& images, bool full_range) {
    const bool reads_off = !full_range && !options.track_right;
    const int views = reads_off ? 1 : 2;
    if (full_range) {
      search_band.full_range();
    } else if (options.search == SearchMode::kFull) {
      search_band.full_range(predicted, views);
    } else {
      const StereoMaps* coarse = coarse_match ? &(*coarse_match)(images) : nullptr;
      search_band(predicted, updated, coarse, &prediction_state(*memory.belief), views);
    }
    stages_of(images.type).census(images.pixels, codes);
    stages_of(images.type).step_penalties(images.pixels, penalties, views);
    banded_sgm(codes, penalties, search_band, scratch, reads_off ? RightView::kReadOff : RightView::kMatched);
    median_filter(scratch, Holes::kLeave);
    check_measurement(reads_off);
    speckle_removal(*measured, views);
  }

  void check_measurement(bool is_read_off) {
    const ConsistencyCheckOptions& check = options.consistency;
    if (is_read_off) {
      consistency(scratch, check.read_off_px, check.measurement_px, prediction_state(*memory.belief),
                  OutsideView::kDrop, *measured);
    } else {
      consistency(scratch, check.measurement_px, OutsideView::kDrop, *measured);
    }
  }

  /// Of the match: a second one where the first gives the vertical offset.
  int passes() const { return vertical_alignment.is_unknown() ? 2 : 1; }

  /// Returns the images that were matched.
  const FrameImages& match(const FrameImages& uploaded, bool full_range) {
    const FrameImages* images = &vertical_alignment.align(uploaded);
    match_aligned(*images, full_range);
    if (passes() == 2) {
      vertical_alignment.estimate(*images, *measured);
      images = &vertical_alignment.realign(uploaded);
      match_aligned(*images, full_range);
    }
    vertical_alignment.estimate(*images, *measured);
    return *images;
  }

  void update(const FrameImages& images) {
    prediction_check(&prediction_state(*memory.belief), *updated, predicted, *measured, prediction_state(*updated));
    kalman_update(prediction_state(*updated), *updated, predicted, *measured, *updated,  // which held the warped map
                  tracked_views());
    median_filter(*updated, Holes::kFill, tracked_views());
    if (!options.track_right) right_map(*measured, options.consistency.update_px, *updated);
    consistency(*updated, options.consistency.update_px, OutsideView::kKeep, scratch);
    stages_of(images.type).sad_check(images.pixels, scratch, *updated);
  }

  /// What is known of the predictions of the frame that left, or will leave, `belief`.
  PredictionCheck::State& prediction_state(const StereoMaps& belief) {
    return prediction_states[&belief - pool.data()];
  }

  /// All that happens on the device. `reason`: see `full_range_reason`.
  FrameResults run_stages(const FrameImages& uploaded, const std::optional<Motion>& motion, const char* reason,
                          const Wanted& wanted) {
    if (!reason) predict(*motion);
    const FrameImages& images = match(uploaded, reason);
    if (reason && options.temporal) {
      prediction_check(nullptr, predicted, predicted, *measured, prediction_state(*measured));
    }
    if (!reason) update(images);
    const StereoMaps* result = reason ? measured : updated;
    const StereoMaps* prediction = reason ? nullptr : &predicted;
    const bool is_output_variance = options.output_variance.enabled && wanted.variance_views > 0;
    if (is_output_variance) output_variance(*result, *measured, wanted.variance_views, scratch, *wanted.variance);
    const auto* dynamic = wanted.dynamic ? &dynamic_map(prediction, *measured, scratch) : nullptr;
    return {.result = result,
            .variance = is_output_variance ? wanted.variance : &result->variance,
            .predicted = prediction,
            .measured = measured,
            .band = &search_band,
            .matched = {passes(), &banded_sgm.stripes(), reason || !coarse_match ? 0 : coarse_match->matched_cells()},
            .vertical_offset_px = &vertical_alignment.offset_px(),
            .dynamic = dynamic};
  }

  void submit(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
              const FrameOutputs& outputs) {
    expect_device_frame_not_failed();
    expect_none_failed();
    FrameUnderWay frame{&begin_frame(), memory, nullptr, {}, {}, Clock::now()};
    ocl::Drain drain{context};
    release_results();
    const char* reason = full_range_reason(motion);
    const FrameImages& uploaded = frame.transfer->upload(left, right);
    if (!under_way.empty()) context.let_wait(ocl::Queue::kKernels, under_way.back().transfer->scratch_fetched());
    const int views = outputs.right_variance.data ? 2 : outputs.variance.data ? 1 : 0;
    const FrameResults results = run_stages(
        uploaded, motion, reason, {views, &frame.transfer->output_variance(), outputs.dynamic.data != nullptr});
    frame.transfer->download(results, outputs);

    drain.is_dismissed = true;
    frame.report.stripes = static_cast<int>(banded_sgm.stripes().size());
    frame.report.full_range = is_full_range(reason);
    frame.report.full_range_reason = reason_text(reason);
    frame.result = results.result;
    frame.commands = context.take_commands();
    under_way.push_back(std::move(frame));
    advance(results);
  }

  /// From here on the next frame rests on this one.
  void advance(const FrameResults& results) {
    vertical_alignment.commit();
    memory = {options.temporal ? results.result : nullptr, memory.no_belief_reason, vertical_alignment.state()};
  }

  bool is_full_range(const char* reason) const { return reason || options.search == SearchMode::kFull; }
  const char* reason_text(const char* reason) const {
    return reason ? reason : options.search == SearchMode::kFull ? "search is full" : "";
  }

  void expect_device_frame_not_failed() {
    const std::vector<ocl::Command> commands = std::exchange(device_frame, {});
    try {
      context.expect_none_failed(commands);
    } catch (...) {
      context.drain();
      reset();
      throw;
    }
  }

  DeviceMaps enqueue(const FrameImages& images, const std::optional<Motion>& motion, cl_event* done) {
    expect_device_frame_not_failed();
    FrameTransfer& transfer = begin_frame();
    ocl::Drain drain{context};
    release_results();
    const char* reason = full_range_reason(motion);
    const FrameResults results =
        run_stages(images, motion, reason, {2, &transfer.output_variance(), options.dynamic_map.enabled});
    const cl::Event end = done ? context.end_of_recorded() : cl::Event();

    drain.is_dismissed = true;
    device_frame = context.take_commands();
    if (done) {
      *done = end();
      ::clRetainEvent(*done);
    }
    advance(results);
    return {.disparity = results.result->disparity.get()(),
            .variance = results.variance->get()(),
            .full_range = is_full_range(reason),
            .full_range_reason = reason_text(reason),
            .dynamic = results.dynamic ? results.dynamic->get()() : nullptr};
  }

  FrameReport collect() {
    FrameUnderWay& frame = under_way.front();
    or_go_back([&] {
      report_stages(context.wait(frame.commands), frame.report);
      if (records_commands) report_commands(context, frame.commands, frame.report);
    });
    expect_none_failed();
    frame.transfer->collect(frame.report);
    const Clock::time_point now = Clock::now();
    frame.report.total_ms = std::chrono::duration<double, std::milli>(now - std::max(frame.start, collected)).count();
    collected = now;
    FrameReport report = std::move(frame.report);
    under_way.erase(under_way.begin());
    return report;
  }

  /// Takes maps that are neither the belief nor those of a frame under way, and a transfer that is free.
  FrameTransfer& begin_frame() {
    const FrameUnderWay* other = under_way.empty() ? nullptr : &under_way.front();
    measured = updated = nullptr;
    for (StereoMaps& maps : pool) {
      const bool is_taken =
          &maps == memory.belief || (other && (&maps == other->before.belief || &maps == other->result));
      if (!is_taken) (measured ? updated : measured) = &maps;
    }
    vertical_alignment.keep(other ? other->before.alignment : memory.alignment);
    return other && other->transfer == &transfers[0] ? transfers[1] : transfers[0];
  }

  /// Gives the results of frames that were collected back to the device.
  void release_results() {
    for (FrameTransfer& transfer : transfers) {
      if (under_way.empty() || under_way.front().transfer != &transfer) transfer.release();
    }
  }

  /// Also one behind the oldest: commands after a failed one may have overtaken those before it.
  void expect_none_failed() {
    or_go_back([&] {
      for (const FrameUnderWay& frame : under_way) context.expect_none_failed(frame.commands);
    });
  }

  /// Where `f` throws, a frame failed: it and those submitted after it, which rest on it, never were.
  template <typename F>
  void or_go_back(F&& f) {
    try {
      f();
    } catch (...) {
      context.drain();
      memory = under_way.front().before;
      vertical_alignment.go_back(memory.alignment);
      under_way.clear();
      throw;
    }
  }

  void reset() {
    vertical_alignment.reset();
    memory = {nullptr, "reset", vertical_alignment.state()};
    for (FrameUnderWay& frame : under_way) frame.before = memory;
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
  if (under_way() > 0) throw InvalidArgument("process: a frame that was submitted is under way: collect it first");
  submit(left, right, motion, outputs);
  return collect();
}

void Pipeline::submit(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
                      const FrameOutputs& outputs) {
  if (under_way() == kMaxUnderWay) {
    throw InvalidArgument("submit: " + std::to_string(kMaxUnderWay) + " frames are under way: collect one first");
  }
  impl_->transfers[0].validate(left, right, outputs);
  if (motion) motion->validate();
  ocl::translated(impl_->context, [&] { impl_->submit(left, right, motion, outputs); });
}

FrameReport Pipeline::collect() {
  if (under_way() == 0) throw InvalidArgument("collect: no frame is under way: submit one first");
  return ocl::translated(impl_->context, [&] { return impl_->collect(); });
}

int Pipeline::under_way() const { return static_cast<int>(impl_->under_way.size()); }
void Pipeline::reset() { impl_->reset(); }
void Pipeline::record_commands(bool wanted) { impl_->records_commands = wanted; }
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

namespace {

Device device_on(cl_command_queue queue, const std::string& programs) {
  if (!queue) throw InvalidArgument("DevicePipeline: no queue: give a cl_command_queue");
  return ocl::translated("DevicePipeline", [&] {
    const cl::CommandQueue kernels(queue, /*retainObject=*/true);
    if (kernels.getInfo<CL_QUEUE_PROPERTIES>() & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) {
      throw InvalidArgument("DevicePipeline: the queue runs out of order: give one that runs in order");
    }
    Device::Handle handle = Device::Handle::of(kernels.getInfo<CL_QUEUE_DEVICE>());
    handle.queue = kernels;
    const Device device(std::make_shared<const Device::Handle>(std::move(handle)));
    return programs.empty() ? device : device.with_programs(programs);
  });
}

FrameImages images_on(const ocl::Context& context, const DeviceImages& images, shared::ImageSize size) {
  if (!images.pixels == !images.svm_pixels) {
    throw InvalidArgument(images.pixels ? "enqueue: images as cl_mem and as pointer: give one of them"
                                        : "enqueue: no images: give a cl_mem, or a pointer of clSVMAlloc");
  }
  const std::size_t needed = 2 * pixel_count(size) * (images.type == PixelType::kU8 ? 1 : 2);
  if (images.svm_pixels) {
    const cl::Buffer buffer = ocl::buffer_in_svm(context.get(), context.device(), images.svm_pixels, needed);
    return {ocl::Buffer<cl_uchar>(buffer, needed), images.type};
  }
  const cl::Buffer buffer(images.pixels, /*retainObject=*/true);
  const std::size_t bytes = buffer.getInfo<CL_MEM_SIZE>();
  if (buffer.getInfo<CL_MEM_CONTEXT>()() != context.get()()) {
    throw InvalidArgument("enqueue: the images are in another context than the queue: create them in the queue's");
  }
  if (bytes < needed) {
    throw InvalidArgument("enqueue: the images' buffer has " + std::to_string(bytes) + " bytes, a pair needs " +
                          std::to_string(needed) + ": left image, then right image, without gaps");
  }
  return {ocl::Buffer<cl_uchar>(buffer, bytes), images.type};
}

}  // namespace

DevicePipeline::DevicePipeline(cl_command_queue queue, const Calibration& calibration, int width, int height,
                               const PipelineOptions& options, const std::string& programs)
    : pipeline_(calibration, width, height, options, device_on(queue, programs)) {}

DeviceMaps DevicePipeline::enqueue(const DeviceImages& images, const std::optional<Motion>& motion, cl_event* done) {
  Pipeline::Impl& impl = *pipeline_.impl_;
  if (pipeline_.under_way() > 0) {
    throw InvalidArgument("enqueue: a frame that was submitted is under way: collect it first");
  }
  if (motion) motion->validate();
  return ocl::translated(impl.context, [&] {
    impl.context.enter("enqueue");
    return impl.enqueue(images_on(impl.context, images, impl.size), motion, done);
  });
}

}  // namespace egosgm
