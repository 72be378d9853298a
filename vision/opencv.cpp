// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/opencv.h"

#include "egosgm/error.h"

namespace egosgm::vision {

FrameMaps process(Pipeline& pipeline, const cv::Mat& left, const cv::Mat& right, const std::optional<Motion>& motion) {
  FrameMaps maps{cv::Mat(left.size(), CV_32FC1), cv::Mat(left.size(), CV_32FC1), {}};
  FrameOutputs outputs;
  outputs.disparity = map_view(maps.disparity);
  outputs.variance = map_view(maps.variance);
  maps.report = pipeline.process(image_view(left), image_view(right), motion, outputs);
  return maps;
}

ImageView image_view(const cv::Mat& grey) {
  if (grey.type() != CV_8UC1 && grey.type() != CV_16UC1) {
    throw InvalidArgument("image_view: the image must be grey, CV_8UC1 or CV_16UC1");
  }
  return {.data = grey.data,
          .width = grey.cols,
          .height = grey.rows,
          .stride_bytes = static_cast<std::ptrdiff_t>(grey.step[0]),
          .type = grey.depth() == CV_8U ? PixelType::kU8 : PixelType::kU16};
}

MapView<float> map_view(cv::Mat& map) {
  if (map.type() != CV_32FC1) throw InvalidArgument("map_view: the map must be CV_32FC1");
  return {.data = map.ptr<float>(),
          .width = map.cols,
          .height = map.rows,
          .stride_bytes = static_cast<std::ptrdiff_t>(map.step[0])};
}

}  // namespace egosgm::vision
