// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/device.h"
#include "egosgm/export.h"
#include "egosgm/frame.h"
#include "egosgm/image.h"
#include "egosgm/motion.h"
#include "egosgm/options.h"

namespace egosgm {

/// Dense disparity from stereo video (Fućek et al. 2017): the last frame's disparity map, moved by the camera's motion,
/// says where to search, and a Kalman filter per pixel fuses what was predicted with what was measured.
///
/// Not thread-safe; two pipelines may run in two threads, also on one device. A pipeline that was moved from may be
/// destroyed or assigned to, and nothing else.
class EGOSGM_EXPORT Pipeline {
 public:
  /// Allocates all memory for images of exactly `width` x `height`, and builds the kernels for disparities of images of
  /// `type`: see `prepare` for all else. Throws InvalidArgument, DeviceError or BuildError.
  Pipeline(const Calibration& calibration, int width, int height, const PipelineOptions& options = {},
           const Device& device = Device::select(), PixelType type = PixelType::kU8);
  ~Pipeline();
  Pipeline(Pipeline&&) noexcept;
  Pipeline& operator=(Pipeline&&) noexcept;

  /// Builds what frames of `type` with such outputs need, as far as it is not built yet, so that none of them waits for
  /// a compiler; without, the first of them does. Of the outputs it is asked which have memory, not which size.
  /// REQUIRES: no frame is under way. Throws DeviceError or BuildError.
  void prepare(PixelType type, const FrameOutputs& outputs);

  /// Matches one rectified pair, both images of the same type, and fills `outputs`.
  /// `motion`: how the camera moved since the last frame that was processed; none: the whole range is searched. Images
  /// that equal those of the last frame are of the same moment: the motion given with them counts for the next frame.
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
  friend class DevicePipeline;  // egosgm/opencl.h
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace egosgm
