// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/calib3d.hpp>

namespace egosgm::bench {

struct OpencvMode {
  const char* name;
  int mode;
};

/// Eight paths, four, five, three; only the first two keep costs of the whole image.
inline constexpr OpencvMode kOpencvModes[] = {{"opencv_hh", cv::StereoSGBM::MODE_HH},
                                              {"opencv_hh4", cv::StereoSGBM::MODE_HH4},
                                              {"opencv_sgbm", cv::StereoSGBM::MODE_SGBM},
                                              {"opencv_3way", cv::StereoSGBM::MODE_SGBM_3WAY}};

/// With the penalties that OpenCV's documentation gives and the other settings of its sample stereo_match, but without
/// speckle removal.
inline cv::Ptr<cv::StereoSGBM> make_opencv_matcher(int mode, int disparities) {
  constexpr int kBlock = 5, kDisp12MaxDiff = 1, kPreFilterCap = 63, kUniquenessRatio = 10;
  return cv::StereoSGBM::create(/*minDisparity=*/0, (disparities + 15) / 16 * 16, kBlock, 8 * kBlock * kBlock,
                                32 * kBlock * kBlock, kDisp12MaxDiff, kPreFilterCap, kUniquenessRatio,
                                /*speckleWindowSize=*/0, /*speckleRange=*/0, mode);
}

}  // namespace egosgm::bench
