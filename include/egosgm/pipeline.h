// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/device.h"
#include "egosgm/export.h"
#include "egosgm/image.h"
#include "egosgm/motion.h"
#include "egosgm/options.h"

namespace egosgm {

struct ProgramFile;  // egosgm/programs.h

/// Where a frame's maps go: views of the caller's memory, width x height of the pipeline each. Empty views are not
/// filled and cost nothing. Disparities in pixels, variances in px^2; kInvalidDisparity (and variance 0) where there is
/// no value.
struct FrameOutputs {
  MapView<float> disparity, variance;              // the left view's result
  MapView<float> right_disparity, right_variance;  // the right view's
  MapView<float> predicted, predicted_variance;    // left, before matching
  MapView<float> measured, measured_variance;      // left, after matching and its checks
  MapView<std::uint16_t> search_width;             // left: disparities that can win at each pixel
  // left: 255 where prediction and measurement contradict each other, as on what moves by itself towards or away from
  // the camera; else 0, also where one of them is missing, as in every frame without a prediction
  MapView<std::uint8_t> dynamic;
};

/// Why a frame has no prediction; kNo: it has one. By name: "", "first frame", "reset", "no motion", "not temporal".
enum class Unpredicted { kNo, kFirstFrame, kReset, kNoMotion, kNotTemporal };
EGOSGM_EXPORT const char* to_string(Unpredicted reason);

/// Device time of a stage in one frame.
struct StageTime {
  std::string stage;
  double ms = 0;
};

/// A command of a frame on the device. Times by the driver, as std::chrono::steady_clock would say, or nearly so.
struct DeviceCommand {
  std::string stage;
  std::string name;  // of the kernel, or "map", "unmap", "read", "write", "fill", "wait" (for another queue)
  DeviceQueue queue = DeviceQueue::kKernels;
  std::int64_t queued_ns = 0, submitted_ns = 0, started_ns = 0, ended_ns = 0;
};

/// What happened in a frame.
///
/// `search_fraction`: all cells (a pixel and a disparity) that were matched / (width * height * D) of each view that
/// was searched at full size: the left one alone, or both in a frame of full range or with track_right. All: lanes
/// beside a band that were computed and cannot win, what CoarseMatch matched of both views, the second match of a frame
/// that knows no vertical offset, rows that stripes share. 1: as many as one match of the full range has; a first frame
/// has 2, and a D that fills no whole chunks more.
struct FrameReport {
  Unpredicted unpredicted = Unpredicted::kNo;  // why nothing was predicted
  bool searched_everything = false;     // the whole range at every pixel: without a prediction, or not trusting it
  double search_fraction = 0;           // see below
  double predicted_fraction = 0;        // left pixels with a prediction
  double density = 0;                   // left pixels with a disparity
  double vertical_offset_px = 0;        // by which the middle of the right image was resampled
  int launches = 0;                     // kernels enqueued
  int stripes = 1;                      // in which the image was matched; more than 1 where memory is too small
  std::vector<StageTime> stages;        // in the order in which they ran
  std::vector<DeviceCommand> commands;  // each of them, after record_commands(true)
  double total_ms = 0;                  // wall clock, upload to download, from when the frame before was collected
};

/// Dense disparity from stereo video (Fućek et al. 2017): the last frame's disparity map, moved by the camera's motion,
/// says where to search, and a Kalman filter per pixel fuses what was predicted with what was measured.
///
/// Not thread-safe; two pipelines may run in two threads, also on one device.
class EGOSGM_EXPORT Pipeline {
 public:
  /// Allocates all memory for images of exactly `width` x `height`, and builds the kernels for those of `type`; what
  /// the other type needs is built before its first frame. Throws InvalidArgument, DeviceError or BuildError.
  Pipeline(const Calibration& calibration, int width, int height, const PipelineOptions& options = {},
           const Device& device = Device::select(), PixelType type = PixelType::kU8);
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  /// Matches one rectified pair, both images of the same type, and fills `outputs`.
  /// `motion`: how the camera moved since the last frame that was processed; none: the whole range is searched.
  /// Throws InvalidArgument before anything is enqueued, or DeviceError. A frame that throws leaves the pipeline as it
  /// was, so the next one gives the bits that it would have given.
  FrameReport process(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
                      const FrameOutputs& outputs);

  /// `process` in two halves, so that the host may prepare the next frame while the device is at work, and a frame's
  /// transfers run beside another's kernels. Gives the same bits.
  ///
  /// `submit` copies the images, enqueues the frame and returns; the memory of `outputs` must live until `collect`,
  /// which waits for the oldest frame under way and fills its outputs.
  ///
  /// Both throw InvalidArgument out of turn: with kMaxUnderWay frames, or none, under way. Where a frame under way has
  /// failed, the next of either throws DeviceError and drops all of them, since they rest on one another: no output is
  /// touched, the pipeline is as it was before the oldest of them, and `under_way` is 0. Else a `submit` that throws
  /// leaves the frames before it under way.
  void submit(const ImageView& left, const ImageView& right, const std::optional<Motion>& motion,
              const FrameOutputs& outputs);
  FrameReport collect();

  static constexpr int kMaxUnderWay = 2;
  int under_way() const;  // frames submitted and not collected

  /// Forgets the last frame: the next one searches the whole range. Frames under way are not affected.
  void reset();

  /// Whether reports of frames collected from now on list every command; off by default.
  void record_commands(bool wanted);

  const PipelineOptions& options() const;
  const Device& device() const;
  std::uint64_t device_memory_bytes() const;  // allocated on the device, constant

 private:
  friend std::vector<ProgramFile> compile_programs(const Device&, const PipelineOptions&);
  friend class DevicePipeline;  // egosgm/opencl.h
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace egosgm
