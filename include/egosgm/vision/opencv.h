// SPDX-License-Identifier: Apache-2.0
// Frames from and to cv::Mat.
#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "egosgm/export.h"
#include "egosgm/image.h"
#include "egosgm/motion.h"
#include "egosgm/pipeline.h"

namespace egosgm::vision {

/// The left view's maps of one frame, CV_32FC1.
struct FrameMaps {
  cv::Mat disparity;  // [px], kInvalidDisparity where there is none
  cv::Mat variance;   // [px^2], 0 where there is no disparity
  FrameReport report;
};

/// Pipeline::process for a rectified pair, both CV_8UC1 or both CV_16UC1, which need not be continuous. `motion`: how
/// the camera moved since the last frame; none: the whole range is searched. Each call gives maps of its own. Throws as
/// Pipeline::process does, and InvalidArgument for other types.
EGOSGM_EXPORT FrameMaps process(Pipeline& pipeline, const cv::Mat& left, const cv::Mat& right,
                                const std::optional<Motion>& motion);

/// The core's view of a cv::Mat; the Mat must outlive it. Throws InvalidArgument unless CV_8UC1 or CV_16UC1.
EGOSGM_EXPORT ImageView image_view(const cv::Mat& grey);

/// The core's view of a CV_32FC1 map that it is to fill. Throws InvalidArgument for another type.
EGOSGM_EXPORT MapView<float> map_view(cv::Mat& map);

}  // namespace egosgm::vision
