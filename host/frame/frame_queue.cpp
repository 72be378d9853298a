// SPDX-License-Identifier: Apache-2.0
#include "host/frame/frame_queue.h"

#include <algorithm>

#include "host/frame/check_frame.h"
#include "host/grey_levels.h"
#include "host/pair_hash.h"
#include "host/tuning_defaults.h"

namespace egosgm {
namespace {

/// The images that show the driver all kernels are this wide, and as high as others, for every launch.
constexpr int kRehearsedWidth = 16;

/// `motion` from the last frame, as one from the images of the belief.
std::optional<Motion> since_images(const Belief& belief, const std::optional<Motion>& motion) {
  return motion ? std::optional(*motion * belief.since) : std::nullopt;
}

}  // namespace

ocl::Context context_on(const Device::Handle& device) {
  return device.queue() ? ocl::Context(device.queue, device.programs, device.cache)
                        : ocl::Context(device.device, device.programs, device.cache);
}

MethodOptions method_of(const PipelineOptions& options, const Tuning& tuning) {
  MethodOptions method(options);
  Scheduling& scheduling = method.banded_sgm.scheduling;
  if (scheduling == Scheduling::kAutomatic) scheduling = tuning.scheduling;
  return method;
}

FrameQueue::FrameQueue(const Calibration& calibration, shared::ImageSize size, const PipelineOptions& options,
                       const Device& device, PixelType type)
    : options_(options),
      device_(device),
      calibration_(calibration),
      size_(size),
      tuning_(with_defaults(device.handle().tuning, device.info())),
      method_options_(method_of(options, tuning_)),
      context_(context_on(device.handle())),
      method_(context_, size, calibration, method_options_, tuning_),
      transfers_{{{context_, size, range_of(method_options_)}, {context_, size, range_of(method_options_)}}},
      memory_{{{context_, size}, {context_, size}, {context_, size}}},
      belief_(memory_.front()) {
  prepare(type, {});
}

void FrameQueue::build(PixelType type, const Wanted& wanted) {
  check_type("", type);
  method_.prepare(type, wanted);
  context_.build();
}

void FrameQueue::prepare(PixelType type, const Wanted& wanted) {
  build(type, wanted);
  const ocl::Context::Apart apart(context_);
  const shared::ImageSize narrow{std::min(size_.width, kRehearsedWidth), size_.height};
  Method method(context_, narrow, calibration_, method_options_, tuning_);
  method.prepare(type, wanted);
  context_.build();
  Belief none(context_, narrow), first(context_, narrow), second(context_, narrow);
  Map disparity(context_, 2 * pixel_count(narrow)), variance(context_, 2 * pixel_count(narrow));
  FrameImages images{ocl::Buffer<cl_uchar>(context_, 2 * 2 * pixel_count(narrow)), type};
  images.pixels.write(context_, std::vector<cl_uchar>(images.pixels.size()));
  const ocl::Drain drain{context_};
  method.frame(plan_of(method_options_, none.why_not, false, {}, wanted), images, none, first, {disparity, variance});
  method.frame(plan_of(method_options_, first.why_not, first.offset.is_known, Motion(), wanted), images, first, second,
               {disparity, variance});
  context_.wait();
}

void FrameQueue::submit(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
                        const FrameOutputs& outputs) {
  expect_device_frames_not_failed();
  expect_none_failed();
  const Wanted wanted = wanted_of(outputs);
  build(left.type, wanted);
  FrameUnderWay frame{&free_transfer(), belief_, free_memory(), {}, {}, Clock::now()};
  ocl::Drain drain{context_};
  release_results();
  frame.after.images = method_options_.temporal ? std::optional(hash_of(left, right)) : std::nullopt;
  const bool repeats = motion && !belief_.why_not && belief_.images && belief_.images == frame.after.images;
  const std::optional<Motion> moved = since_images(belief_, motion);
  frame.after.since = repeats ? *moved : Motion();
  Plan plan =
      plan_of(method_options_, belief_.why_not, belief_.offset.is_known, repeats ? Motion() : moved, wanted, repeats);
  if (wanted.has(Output::kReason)) plan.grey_step = levels_of(left, right).step();
  const FrameImages& images = frame.transfer->upload(left, right);
  if (under_way() > 0) context_.let_wait(ocl::Queue::kKernels, under_way_.back().transfer->scratch_fetched());
  const FrameResults results = method_.frame(plan, images, belief_, frame.after, frame.transfer->output());
  const Workspace& workspace = method_.workspace();
  frame.transfer->download(
      {.result = results.output,
       .predicted = plan.predicts() ? &workspace.prediction.maps : nullptr,
       .measured = results.measured,
       .bands = workspace.bands,
       .matched = plan.matched,
       .parts = {plan.matches, &method_.matcher().banded_sgm().stripes(),
                 plan.has_coarse_match ? method_.search().coarse_cells() : 0, plan.matched.row_step},
       .offset = results.offset,
       .published = workspace.published.maps(wanted)},
      outputs);
  context_.flush();

  drain.is_dismissed = true;
  frame.report.stripes = static_cast<int>(method_.matcher().banded_sgm().stripes().size());
  frame.report.unpredicted = plan.why_not;
  frame.report.repeated = repeats;
  frame.commands = context_.take_commands();
  belief_ = frame.after;
  under_way_.push_back(std::move(frame));
}

DeviceMaps FrameQueue::enqueue(const FrameImages& images, const std::optional<Motion>& motion, cl_event* done,
                               bool wants_dynamic) {
  expect_device_frames_not_failed();
  Wanted wanted = kOnDevice;
  if (wants_dynamic) wanted.add(Output::kDynamic);
  build(images.type, wanted);
  FrameTransfer& transfer = free_transfer();
  Belief after = free_memory();
  ocl::Drain drain{context_};
  release_results();
  const Plan plan =
      plan_of(method_options_, belief_.why_not, belief_.offset.is_known, since_images(belief_, motion), wanted);
  after.images.reset();
  after.since = Motion();
  const StereoMaps result = method_.frame(plan, images, belief_, after, transfer.output()).output;
  const cl::Event end = done ? context_.end_of_recorded() : cl::Event();
  context_.flush();

  drain.is_dismissed = true;
  for (ocl::Command& command : context_.take_commands()) device_frames_.push_back(std::move(command));
  if (done) {
    *done = end();
    ::clRetainEvent(*done);
  }
  belief_ = after;
  return {.disparity = result.disparity.get()(),
          .variance = result.variance.get()(),
          .unpredicted = plan.why_not,
          .dynamic = wants_dynamic ? method_.workspace().published.dynamic.get()() : nullptr};
}

FrameReport FrameQueue::collect() {
  FrameUnderWay& frame = under_way_.front();
  or_go_back([&] {
    report_stages(context_.wait(frame.commands), frame.report);
    if (records_commands_) report_commands(context_, frame.commands, frame.report);
  });
  expect_none_failed();
  expect_device_frames_not_failed();
  frame.transfer->collect(frame.report);
  const Clock::time_point now = Clock::now();
  frame.report.total_ms = std::chrono::duration<double, std::milli>(now - std::max(frame.start, collected_)).count();
  collected_ = now;
  FrameReport report = std::move(frame.report);
  under_way_.erase(under_way_.begin());
  return report;
}

void FrameQueue::reset() {
  belief_.forget(Unpredicted::kReset);
  for (FrameUnderWay& frame : under_way_) frame.before.forget(Unpredicted::kReset);
}

FrameTransfer& FrameQueue::free_transfer() {
  const bool is_first_taken = under_way() > 0 && under_way_.front().transfer == &transfers_[0];
  return is_first_taken ? transfers_[1] : transfers_[0];
}

/// Memory that neither the belief has nor a frame under way, which may have to be gone back from.
Belief& FrameQueue::free_memory() {
  return *std::find_if(memory_.begin(), memory_.end(), [&](const Belief& memory) {
    return !memory.shares_memory_with(belief_) &&
           std::none_of(under_way_.begin(), under_way_.end(), [&](const FrameUnderWay& frame) {
             return memory.shares_memory_with(frame.before) || memory.shares_memory_with(frame.after);
           });
  });
}

/// Gives the results of frames that were collected back to the device.
void FrameQueue::release_results() {
  for (FrameTransfer& transfer : transfers_) {
    if (under_way_.empty() || under_way_.front().transfer != &transfer) transfer.release();
  }
}

/// Those that have not ended may still fail, also with later frames behind them.
void FrameQueue::expect_device_frames_not_failed() {
  std::vector<ocl::Command> commands = std::exchange(device_frames_, {});
  try {
    device_frames_ = context_.unfinished(std::move(commands));
  } catch (...) {
    context_.drain();
    under_way_.clear();
    reset();
    throw;
  }
}

/// Also one behind the oldest: commands after a failed one may have overtaken those before it.
void FrameQueue::expect_none_failed() {
  or_go_back([&] {
    for (const FrameUnderWay& frame : under_way_) context_.expect_none_failed(frame.commands);
  });
}

/// If `f` throws, a frame failed: the queue forgets it and those submitted after it, which rest on it.
template <typename F>
void FrameQueue::or_go_back(F&& f) {
  try {
    f();
  } catch (...) {
    context_.drain();
    belief_ = under_way_.front().before;
    under_way_.clear();
    throw;
  }
}

}  // namespace egosgm
