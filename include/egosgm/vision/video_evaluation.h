// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/vision/evaluation.h"

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

/// Sizes of errors of a change from one frame to the next.
struct EGOSGM_EXPORT TemporalCounts {
  double sum_px = 0;
  std::int64_t pixels = 0, above_1px = 0, above_3px = 0;
  double relative_sum = 0;  // |error| / (|true change| + 0.001)
  std::int64_t relative_above_1 = 0;
  double sum_of_pair_means_px = 0;
  int pairs = 0;  // that have such pixels

  TemporalCounts& operator+=(const TemporalCounts& other);
};

/// A figure that is the mean of each pair's own mean.
struct EGOSGM_EXPORT PairMean {
  double sum = 0;
  int pairs = 0;

  PairMean& operator+=(const PairMean& other);
  double value() const;  // NaN without pairs
};

/// Pixels with truth where both methods have an estimate; `changed`: they differ by more than 1 px.
struct EGOSGM_EXPORT ChangeCounts {
  std::int64_t both = 0, changed = 0, worse = 0, better = 0;

  ChangeCounts& operator+=(const ChangeCounts& other);
};

/// What is left if the least certain pixels are dropped. Share k keeps 2 * (k + 1) percent of each frame's pixels that
/// have truth, estimate and uncertainty.
struct EGOSGM_EXPORT DensityCounts {
  static constexpr int kShares = 50;
  std::array<std::int64_t, kShares> kept{}, bad{}, oracle_bad{};
  std::array<double, kShares> error_px{}, oracle_error_px{};  // sums of |error|
  /// Density k keeps 50 + 5 k percent of the pixels that have truth, or all that there are.
  static constexpr int kDensities = 11;
  std::array<std::int64_t, kDensities> kept_of_truth{}, bad_of_kept{};
  std::int64_t truth = 0;

  DensityCounts& operator+=(const DensityCounts& other);
  double ause_px() const;       // of the mean |error| [px]; NaN without pixels
  double ause_percent() const;  // of the share of bad pixels [percent]
};

/// Parts of the image that are looked at apart, told by truth, masks and motion of the later frame.
enum class Region { kAll, kMoving, kStill, kUncovered, kEdges, kNear, kFar };
inline constexpr std::array<const char*, 7> kRegionNames = {"all",   "moving", "still", "uncovered",
                                                            "edges", "near",   "far"};

struct EGOSGM_EXPORT RegionCounts {
  DisparityCounts errors;
  TemporalCounts tepe, tepe_interpolated;  // same pixel
  ChangeCounts against;

  RegionCounts& operator+=(const RegionCounts& other);
};

/// Of one frame and of the pair that it makes with the frame before; those of several add up.
struct EGOSGM_EXPORT VideoCounts {
  std::array<RegionCounts, kRegionNames.size()> regions;
  TemporalCounts flicker;
  PairMean tae_percent;  // pairs count twice: both directions
  TemporalCounts tepe_along_motion;
  PairMean opw_px, opw_m, rtc_1_01_percent, rtc_1_25_percent;
  DensityCounts density;

  VideoCounts& operator+=(const VideoCounts& other);
  const RegionCounts& region(Region which) const { return regions[static_cast<std::size_t>(which)]; }
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

/// A figure by the name that the program and the Python module give it. NaN where there is nothing to divide by.
struct NamedFigure {
  const char* name;
  double value;
};

/// The figures over time.
EGOSGM_EXPORT std::vector<NamedFigure> figures_of(const VideoCounts& counts);
/// The errors, TEPE, harm and help of one region.
EGOSGM_EXPORT std::vector<NamedFigure> figures_of(const RegionCounts& counts);

}  // namespace egosgm::vision
