// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "host/vision/pair_matches.h"

namespace egosgm::vision {

enum class Verdict { kFine, kNote, kProblem };

struct Finding {
  Verdict verdict;
  std::string check, text, remedy;
};

/// What of a pair is nearer than the range of disparities ends, by a small map of it that looks beyond.
struct Clipped {
  double share;     // of the pixels of which the small map is sure
  int disparities;  // with which the range would hold nearly all
};

/// None where hardly anything is nearer, or where the small map is sure of too little. The range that is searched:
/// [least, end). REQUIRES: rectified images of one size, both CV_8UC1 or both CV_16UC1. Thread-safe.
EGOSGM_EXPORT std::optional<Clipped> clipped_by_range(const cv::Mat& left, const cv::Mat& right, int least, int end);

/// What is wrong with rectified pairs before they are matched: their images, calibration, rows, sides and range. It
/// looks at a few pairs, however they came. Not thread-safe.
class EGOSGM_EXPORT Examination {
 public:
  /// `calibration`: none where the pairs have none. The range of disparities that is to be searched: [least, end).
  Examination(const std::optional<Calibration>& calibration, int least, int end)
      : calibration_(calibration), least_(least), end_(end) {}

  /// Throws as match_pair does.
  void add(const cv::Mat& left, const cv::Mat& right);

  /// `pairs`: how many there are in all. REQUIRES: add was called.
  std::vector<Finding> findings(std::size_t pairs) const;

 private:
  Finding images(std::size_t pairs) const;
  Finding calibration() const;
  Finding rows() const;
  Finding sides(double behind) const;
  Finding range(std::vector<float> disparities) const;

  const std::optional<Calibration> calibration_;
  const int least_, end_;
  cv::Size size_;
  std::vector<PairMatch> matches_;
  std::vector<float> disparities_;  // of coarse maps over the full range
  double left_brightness_ = 0, right_brightness_ = 0;
  std::size_t frames_ = 0, narrow_ = 0, depth_bits_ = 8;  // narrow: 8 bits in 16
};

}  // namespace egosgm::vision
