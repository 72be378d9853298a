// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/image.h"

namespace egosgm::vision {

/// A disparity map; `scale`: steps a pixel of a PNG, and, where it is not KITTI's, of a .npy of whole numbers. Throws
/// as read_disparity does.
EGOSGM_EXPORT Image read_scaled(const std::filesystem::path& file, double scale);

/// Reads disparity maps of other programs, with one rule of what has no value in all formats, and remembers what speaks
/// against them. No value: 0, infinite, NaN; a negative value that is the same at all pixels that have one, as -1 is,
/// and every one of .npy; in a PNG 65520 and more, which is -1 to -16 as unsigned; and what is no smaller than the
/// map's width, which no two images can show. Thread-safe.
class EGOSGM_EXPORT EstimateReader {
 public:
  /// See read_scaled.
  Image read(const std::filesystem::path& file, double scale);

  /// Looks at an estimate beside its truth.
  void compare(const Image& estimate, const Image& truth);

  /// A sentence for each thing that was seen. Both scales: as they were given.
  std::vector<std::string> warnings(double scale, double truth_scale) const;

 private:
  mutable std::mutex mutex_;
  std::int64_t impossible_ = 0, values_ = 0, markers_ = 0;
  float marker_ = 0;
  std::string first_impossible_;
  bool is_compared_ = false, has_truth_ = false, differs_ = false;  // from its truth
  std::vector<double> ratios_, alike_;  // of an estimate to its truth in the median of each map, and the share near it
};

/// Throws InvalidArgument where `option` names another scale than KITTI's, and `file` has none.
EGOSGM_EXPORT void expect_scaled(const std::string& option, double scale, const std::filesystem::path& file);

}  // namespace egosgm::vision
