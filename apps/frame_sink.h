// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/calibration.h"
#include "egosgm/options.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/moving_objects.h"
#include "vision/stereo_video.h"

namespace egosgm::app {

/// The maps of a frame as they come from the device: kF32, and kU8 of reasons. Empty where the run does not make it.
struct ShownMaps {
  vision::Image disparity, variance, reason;
  const vision::LabelledObjects* objects;  // null where the run does not write them
};

/// A sink takes a run's maps beside its folder, or in place of it.
class FrameSink {
 public:
  virtual ~FrameSink() = default;
  /// Before the first frame. Throws InvalidArgument and IoError.
  virtual void begin(const PipelineOptions& options, const Calibration& calibration) = 0;
  virtual void take(const vision::VideoFrame& frame, const ShownMaps& maps) = 0;
  /// All came; or, after a begin that may have thrown, the run stopped.
  virtual void end(bool finished) = 0;
};

}  // namespace egosgm::app
