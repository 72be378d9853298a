// SPDX-License-Identifier: Apache-2.0
// Frames on the caller's own OpenCL queue and in its memory. The only header here that includes OpenCL's.
#pragma once

#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 120
#endif
#include <CL/cl.h>

#include <optional>
#include <string>

#include "egosgm/export.h"
#include "egosgm/pipeline.h"

namespace egosgm {

/// A rectified pair in memory of the queue's context: the left image, then the right one, rows from top to bottom
/// without gaps, 1 or 2 bytes a pixel. Two sub-buffers of it are a way to fill them apart.
struct DeviceImages {
  cl_mem pixels = nullptr;
  PixelType type = PixelType::kU8;
  /// In the place of `pixels`: what clSVMAlloc returned in the queue's context (OpenCL 2.0; coarse-grained suffices,
  /// and is then not mapped while the frame runs). Refused with InvalidArgument where the device has no such memory.
  const void* svm_pixels = nullptr;
};

/// The maps of a frame, in the pipeline's own buffers: floats, the left view's height x width, then the right view's.
/// Disparity [px], kInvalidDisparity where there is none; variance [px^2]. Retain none: they are read by commands of
/// the same queue (or that wait for `done` of `enqueue`), which are enqueued before the next frame is.
struct DeviceMaps {
  cl_mem disparity = nullptr;
  cl_mem variance = nullptr;
  std::optional<Unpredicted> unpredicted;  // as in FrameReport
  cl_mem dynamic = nullptr;                // bytes, the left view's, as in FrameOutputs; null unless it was wanted
};

/// A Pipeline whose kernels run on the caller's queue, between the caller's own commands, on images that are there
/// already: no copy, and the host waits for nothing. Same bits as Pipeline, but for a pair that repeats: what the host
/// does not see counts as a new one. Not thread-safe.
class EGOSGM_EXPORT DevicePipeline {
 public:
  /// The caller's queue is retained. `programs`: a folder of compiled programs, as in Device::with_programs; empty:
  /// compiles. Throws InvalidArgument (also for a queue that runs out of order), DeviceError or BuildError.
  DevicePipeline(cl_command_queue queue, const Calibration& calibration, int width, int height,
                 const PipelineOptions& options = {}, const std::string& programs = {});

  /// Enqueues a frame behind what is enqueued on the queue, and returns. The images must not change until it has ended.
  /// `done`, if not null, becomes an event of its end, whose queue was flushed, and which the caller releases.
  /// `wants_dynamic`: makes DeviceMaps::dynamic, too, which marks nothing where the frame before did not want it.
  /// Throws InvalidArgument before anything is enqueued, or DeviceError: then nothing of the frame is left on the
  /// queue, and the pipeline is as it was before. A frame that fails on the device later (its event says so), also with
  /// others behind it, makes the next call throw DeviceError; that one forgets all of them, as `Pipeline::reset` does.
  DeviceMaps enqueue(const DeviceImages& images, const std::optional<Motion>& motion, cl_event* done = nullptr,
                     bool wants_dynamic = false);

  /// The pipeline itself: options, memory, reset, and frames whose images and maps are the host's, in between. Their
  /// reports name no times where the caller's queue does not profile.
  Pipeline& host() { return pipeline_; }

 private:
  Pipeline pipeline_;
};

}  // namespace egosgm
