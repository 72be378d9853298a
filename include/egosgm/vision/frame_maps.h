// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "egosgm/export.h"
#include "egosgm/motion.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// The left view's maps of one frame, kF32.
struct FrameMaps {
  Image disparity;  // [px], kInvalidDisparity where there is none
  Image variance;   // [px^2], 0 where there is no disparity
  FrameReport report;
};

/// Pipeline::process for a rectified pair, both kU8 or both kU16. `motion`: how the camera moved since the last frame;
/// none: the whole range is searched. Each call gives maps of its own. Throws as Pipeline::process does, and
/// InvalidArgument for other types.
EGOSGM_EXPORT FrameMaps process(Pipeline& pipeline, const Image& left, const Image& right,
                                const std::optional<Motion>& motion);

}  // namespace egosgm::vision
