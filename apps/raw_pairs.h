// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/vision/dataset.h"

namespace egosgm::app {

/// Images one after the other: of a video, of one file, or of all files that a pattern names (`*`, or `%06d`).
/// Not thread-safe.
class ImageSource {
 public:
  virtual ~ImageSource() = default;
  /// The next image, grey or BGR, 8 or 16 bit; empty at the end. Throws InvalidArgument, naming the file.
  virtual cv::Mat next() = 0;
  /// When the last one was taken [s], where that is known.
  virtual std::optional<double> time_s() const = 0;
  /// How many there are; -1 where a video does not say.
  virtual int count() const = 0;
};

std::unique_ptr<ImageSource> open_images(const std::string& pattern);

/// Left and right images of one moment.
struct RawPair {
  cv::Mat left, right;
  std::optional<double> time_s;
};

/// Pairs from one of: two sources, one source with both images side by side, a list, an EuRoC folder.
struct RawPairArguments {
  std::string left, right, side_by_side, list, euroc;
  vision::PairBy pair_by = vision::PairBy::kName;  // of left and right files
};

class RawPairs {
 public:
  virtual ~RawPairs() = default;
  /// Nothing at the end. Throws InvalidArgument, naming the file.
  virtual std::optional<RawPair> next() = 0;
  virtual int count() const = 0;
  /// What was left out, for the user; empty where nothing was. Known in full once next() gave nothing.
  virtual std::string note() const { return {}; }
};

/// Throws InvalidArgument unless exactly one of them was named, and as the sources do.
std::unique_ptr<RawPairs> open_pairs(const RawPairArguments& arguments);

}  // namespace egosgm::app
