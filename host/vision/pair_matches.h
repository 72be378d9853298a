// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "egosgm/export.h"

namespace egosgm::vision {

/// The same point in both images of a pair [px].
struct PairMatch {
  cv::Point2f left, right;
};

/// Points found in both images, wherever they lie: nothing is assumed of rows, of sides or of the range of disparities.
/// Matched by ORB, outliers dropped by a fundamental matrix, refined to a part of a pixel. Throws InvalidArgument
/// unless both are CV_8UC1 or CV_16UC1 of one size. Deterministic. Thread-safe.
EGOSGM_EXPORT std::vector<PairMatch> match_pair(const cv::Mat& left, const cv::Mat& right);

}  // namespace egosgm::vision
