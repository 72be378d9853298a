// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/vision/video_counts.h"

namespace egosgm::vision {

// Figures of a video's disparity maps over time. docs/evaluation.md gives each formula, whose it is, which pixels it
// is taken over, and how it is pooled.

/// What is known of one frame: maps of one size, empty where there is none. Disparities [px] are CV_32FC1 with
/// kInvalidDisparity where there is none, masks CV_8UC1 with 0 for no.
struct VideoFrame {
  cv::Mat estimate;      // never empty
  cv::Mat truth;         // of the pixels that count
  cv::Mat all_truth;     // of occluded pixels too: tells edges and what is uncovered; empty: `truth`
  cv::Mat against;       // another method's estimate
  cv::Mat reason;        // CV_8UC1: the estimate's, as FrameOutputs::reason
  cv::Mat uncertainty;   // CV_32FC1: any number that grows with the expected error, a variance for instance
  cv::Mat moving;        // mask: moves by itself
  cv::Mat image;         // CV_8UC1 or CV_16UC1: the left image, for OPW's and RTC's mask
  cv::Mat flow_to_next;  // CV_32FC2 [px], NaN where there is none
  cv::Mat next_truth;    // the next frame's true disparity of what this frame's pixels show (KITTI 2015's disp_1)
};

/// Frames in order. The functions are called from several threads at once.
struct Video {
  int frames = 0;
  std::function<VideoFrame(int)> read;                                         // frames 0, 1, ...
  std::function<std::optional<Eigen::Isometry3d>(int)> current_from_previous;  // of frame i >= 1; may be empty
  std::function<bool(int)> follows;        // frame i is the one after frame i - 1; empty: always
  std::optional<Calibration> calibration;  // without it, nothing that needs a motion is measured
};

struct VideoEvaluation {
  std::vector<VideoCounts> frames;  // by frame; a pair belongs to its later frame
  VideoCounts total;
};

struct VideoEvaluationOptions {
  float near_px = 32;  // near: a true disparity of at least this
  int threads = 0;     // 0: as many as the machine runs at once
};

/// Evaluates a video in bounded memory, whatever its length. `done` (may be empty) is called after each frame, by one
/// thread at a time. Throws InvalidArgument, naming the frame, where a map's size or type does not fit, and what
/// `read` throws.
EGOSGM_EXPORT VideoEvaluation evaluate_video(const Video& video, const VideoEvaluationOptions& options = {},
                                             const std::function<void(int frame)>& done = {});

/// Every pixel of a disparity map moved to where it lies after the motion, the nearest surface (largest disparity) on
/// top; what is measured over time is compared with this. Thread-safe.
EGOSGM_EXPORT cv::Mat move_map(const cv::Mat& disparity, const Calibration& calibration,
                               const Eigen::Isometry3d& current_from_previous);

}  // namespace egosgm::vision
