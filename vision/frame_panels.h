// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/render.h"

namespace egosgm::vision {

/// A frame and what the pipeline made of it: disparity, variance kF32, search width kU16, reasons kU8.
/// `frame.truth_noc` and `reasons` may be empty.
struct ShownFrame {
  const StereoFrame& frame;
  const Image& left;
  const Image &disparity, &variance, &search_width;
  const Image reasons = {};
};

/// Throws InvalidArgument where the frame's truth, a PNG, is of another size than its images. Reads the header alone.
EGOSGM_EXPORT void expect_truth_of_size(const StereoFrame& frame, Size images);

/// A map as a picture, and its colour scale of the same width (none for an image).
struct Layer {
  std::string name;
  Image picture, bar;
};

/// A sequence's maps as pictures with their scales. Colours stand for the same values in all frames: the first one's
/// range. Not thread-safe.
class EGOSGM_EXPORT FramePanels {
 public:
  explicit FramePanels(int disparities) : disparities_(disparities) {}

  /// The range of the first map that it is asked for.
  const ColorRange& disparity_range(const Image& disparity);
  Image disparity(const Image& disparity);
  /// Left image, disparity, search width, and the error where there is truth, else the variance.
  Image overview(const ShownFrame& shown);
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
