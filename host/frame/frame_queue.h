// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <vector>

#include "egosgm/opencl.h"
#include "host/frame/frame_transfer.h"
#include "host/method/method.h"
#include "host/ocl/device_handle.h"

namespace egosgm {

ocl::Context context_on(const Device::Handle& device);
/// `options` as a pipeline on a device with this tuning runs them.
MethodOptions method_of(const PipelineOptions& options, const Tuning& tuning);

/// The results that these outputs need.
/// Outputs that DevicePipeline always makes.
inline const Wanted kOnDevice{Output::kDisparity, Output::kVariance, Output::kRightDisparity, Output::kRightVariance};

/// Frames on their way: up to two at once, each on the belief that the one before leaves. One that fails takes those
/// that rest on it along, and the belief goes back to what was before it.
class FrameQueue {
 public:
  FrameQueue(const Calibration& calibration, shared::ImageSize size, const PipelineOptions& options,
             const Device& device, PixelType type);
  ~FrameQueue() { context_.drain(); }
  FrameQueue(const FrameQueue&) = delete;
  FrameQueue& operator=(const FrameQueue&) = delete;

  /// Builds what frames of `type` need, and what is wanted of them, and lets the driver make the machine code of all
  /// their kernels: some drivers do that when a kernel first runs. REQUIRES: no frame is under way.
  void prepare(PixelType type, const Wanted& wanted);

  /// See Pipeline. REQUIRES: arguments that were validated, and a frame under way or room for one.
  void submit(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
              const FrameOutputs& outputs);
  FrameReport collect();
  int under_way() const { return static_cast<int>(under_way_.size()); }
  void reset();
  void record_commands(bool wanted) { records_commands_ = wanted; }

  /// See DevicePipeline. REQUIRES: no frame is under way.
  DeviceMaps enqueue(const FrameImages& images, const std::optional<Motion>& motion, cl_event* done,
                     bool wants_dynamic);

  ocl::Context& context() { return context_; }
  const ocl::Context& context() const { return context_; }
  const PipelineOptions& options() const { return options_; }
  const Device& device() const { return device_; }
  shared::ImageSize size() const { return size_; }

 private:
  using Clock = std::chrono::steady_clock;

  struct FrameUnderWay {
    FrameTransfer* transfer;
    Belief before, after;
    FrameReport report;
    std::vector<ocl::Command> commands;
    Clock::time_point start;
  };

  void build(PixelType type, const Wanted& wanted);
  FrameTransfer& free_transfer();
  Belief& free_memory();
  void release_results();
  void expect_device_frames_not_failed();
  void expect_none_failed();
  template <typename F>
  void or_go_back(F&& f);

  const PipelineOptions options_;
  const Device device_;
  const Calibration calibration_;
  const shared::ImageSize size_;
  const Tuning tuning_;
  const MethodOptions method_options_;
  ocl::Context context_;
  Method method_;
  std::array<FrameTransfer, Pipeline::kMaxUnderWay> transfers_;
  std::array<Belief, Pipeline::kMaxUnderWay + 1> memory_;  // of the belief, the one to go back to, and the next one
  Belief belief_;                                          // of the last frame submitted; in one of them
  std::vector<FrameUnderWay> under_way_;                   // the oldest first
  Clock::time_point collected_;                            // the last one before them
  std::vector<ocl::Command> device_frames_;                // of each `enqueue`, as long as they may fail
  bool records_commands_ = false;
};

/// Frames are all that a pipeline has.
struct Pipeline::Impl : FrameQueue {
  using FrameQueue::FrameQueue;
};

}  // namespace egosgm
