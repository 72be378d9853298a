// SPDX-License-Identifier: Apache-2.0
// Images from and to cv::Mat, for those who have OpenCV: egosgm::vision itself does not need it.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// The same memory, which the Image keeps. Throws InvalidArgument unless CV_8U, CV_16U or CV_32F, of any channels.
inline Image image_of(const cv::Mat& mat) {
  const int depth = mat.depth();
  if (mat.dims > 2 || (depth != CV_8U && depth != CV_16U && depth != CV_32F)) {
    throw InvalidArgument("image_of: the matrix is " + cv::typeToString(mat.type()) +
                          ": give two sides of CV_8U, CV_16U or CV_32F");
  }
  const ChannelType channel =
      depth == CV_8U ? ChannelType::kU8 : (depth == CV_16U ? ChannelType::kU16 : ChannelType::kF32);
  Image image(mat.rows, mat.cols, {channel, mat.channels()}, mat.data, mat.step[0]);
  image.owner = std::make_shared<cv::Mat>(mat);
  return image;
}

/// The same memory, which the Image must keep for as long as the matrix is used: clone() gives one of its own.
inline cv::Mat mat_of(const Image& image) {
  if (image.empty()) return {};
  const int depth = image.type.channel == ChannelType::kU8    ? CV_8U
                    : image.type.channel == ChannelType::kU16 ? CV_16U
                                                              : CV_32F;
  return cv::Mat(image.rows, image.cols, CV_MAKETYPE(depth, image.type.channels), image.data, image.stride_bytes);
}

/// The core's view of a cv::Mat; the Mat must outlive it. Throws InvalidArgument unless CV_8UC1 or CV_16UC1.
inline ImageView image_view(const cv::Mat& grey) { return image_view(image_of(grey)); }

/// The core's view of a CV_32FC1 map that it is to fill. Throws InvalidArgument for another type.
inline MapView<float> map_view(cv::Mat& map) {
  Image image = image_of(map);
  return map_view(image);
}

/// The left view's maps of one frame, CV_32FC1.
struct FrameMats {
  cv::Mat disparity;  // [px], kInvalidDisparity where there is none
  cv::Mat variance;   // [px^2], 0 where there is no disparity
  FrameReport report;
};

/// As process (frame_maps.h), for a rectified pair, both CV_8UC1 or both CV_16UC1, which need not be continuous.
inline FrameMats process(Pipeline& pipeline, const cv::Mat& left, const cv::Mat& right,
                         const std::optional<Motion>& motion) {
  FrameMats maps{cv::Mat(left.size(), CV_32FC1), cv::Mat(left.size(), CV_32FC1), {}};
  FrameOutputs outputs;
  outputs.disparity = map_view(maps.disparity);
  outputs.variance = map_view(maps.variance);
  maps.report = pipeline.process(image_view(left), image_view(right), motion, outputs);
  return maps;
}

}  // namespace egosgm::vision
