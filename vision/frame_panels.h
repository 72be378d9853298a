// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/render.h"

namespace egosgm::vision {

/// A frame and what the pipeline made of it: disparity, variance CV_32FC1, search width CV_16UC1, reasons CV_8UC1.
/// `frame.truth_noc` and `reasons` may be empty.
struct ShownFrame {
  const StereoFrame& frame;
  const cv::Mat& left;
  const cv::Mat &disparity, &variance, &search_width;
  const cv::Mat reasons = {};
};

/// Throws InvalidArgument where the frame's truth, a PNG, is of another size than its images. Reads the header alone.
EGOSGM_EXPORT void expect_truth_of_size(const StereoFrame& frame, cv::Size images);

/// A map as a picture, and its colour scale of the same width (none for an image).
struct Layer {
  std::string name;
  cv::Mat picture, bar;
};

/// A sequence's maps as pictures with their scales. Colours stand for the same values in all frames: the first one's
/// range. Not thread-safe.
class EGOSGM_EXPORT FramePanels {
 public:
  explicit FramePanels(int disparities) : disparities_(disparities) {}

  /// The range of the first map that it is asked for.
  const ColorRange& disparity_range(const cv::Mat& disparity);
  cv::Mat disparity(const cv::Mat& disparity);
  /// Left image, disparity, search width, and the error where there is truth, else the variance.
  cv::Mat overview(const ShownFrame& shown);
  /// Left image in its colours, disparity, variance, search width, reasons, and the error: those for which there is a
  /// file or a map (an empty one is none).
  std::vector<Layer> layers(const ShownFrame& shown);

 private:
  Layer disparity_layer(const ShownFrame& shown);
  Layer search_layer(const ShownFrame& shown) const;

  const int disparities_;
  std::optional<ColorRange> range_;
};

}  // namespace egosgm::vision
