// SPDX-License-Identifier: Apache-2.0
// One figure over time each, of two frames in a row. docs/evaluation.md holds the formulas with their sources.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/core.hpp>

#include "egosgm/calibration.h"
#include "egosgm/vision/video_evaluation.h"

namespace egosgm::vision {

/// Where a pixel of the frame before comes to lie: nearest pixel (halves to even) and disparity there.
struct MovedPixel {
  int x = 0, y = 0;
  double disparity = 0;
};

/// Moves pixels with disparity from one frame to another.
class PixelMotion {
 public:
  PixelMotion(const Calibration& calibration, const Eigen::Isometry3d& target_from_source, cv::Size size);

  /// False where the point is at infinity or beyond, behind the target camera, or outside of its image.
  bool operator()(int x, int y, double disparity, MovedPixel& moved) const {
    const double inverse_depth = (disparity + doffs_px_) / (fx_ * baseline_m_);
    if (!(inverse_depth > 0)) return false;
    const Eigen::Vector3d p =
        rotation_ * Eigen::Vector3d((x - cx_) / fx_, (y - cy_) / fy_, 1) + translation_ * inverse_depth;
    if (!(p.z() > 0)) return false;
    const double to_x = std::nearbyint(fx_ * p.x() / p.z() + cx_), to_y = std::nearbyint(fy_ * p.y() / p.z() + cy_);
    if (!(to_x >= 0 && to_x < size_.width && to_y >= 0 && to_y < size_.height)) return false;
    moved = {static_cast<int>(to_x), static_cast<int>(to_y), (disparity + doffs_px_) / p.z() - doffs_px_};
    return true;
  }

 private:
  double fx_, fy_, cx_, cy_, baseline_m_, doffs_px_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_;
  cv::Size size_;
};

/// Mean |e_t - Z(e_t-1)| of the pixels that have both. `moved` is Z(e_t-1).
TemporalCounts count_flicker(const cv::Mat& estimate, const cv::Mat& moved);

/// Video Depth Anything's temporal alignment error, one direction: the mean of |depth - moved depth| / depth [percent].
PairMean temporal_alignment_error(const cv::Mat& estimate, const cv::Mat& moved, double doffs_px);

/// DynamicStereo's and CODD's error of a change, |(e_t - e_t+1) - (d_t - d_t+1)|, of one pixel.
void add_change_error(double estimated_change, double true_change, TemporalCounts& counts);

/// Ends a pair of frames: its mean becomes one of `sum_of_pair_means_px`.
void end_pair(TemporalCounts& counts);

/// CODD's TEPE from true flow: the true change is that of `next_truth` where the frame before has one, else that of the
/// truth at the nearest pixel that the flow leads to.
TemporalCounts tepe_along_flow(const VideoFrame& before, const VideoFrame& now);

/// CODD's TEPE where the flow follows from truth and motion: of what stands still and is not hidden, that is, where the
/// truth that the motion leads to is within 1 px of the truth moved.
TemporalCounts tepe_along_poses(const VideoFrame& before, const VideoFrame& now, const PixelMotion& now_from_before);

/// OPW (NVDS) and RTC (Li et al.) of the pair: along the flow of the frame before, estimates sampled bilinearly.
void add_flow_figures(const VideoFrame& before, const VideoFrame& now, const std::optional<Calibration>& calibration,
                      VideoCounts& counts);

/// Harm, help, gain and loss of one pixel that has truth.
void add_change(float estimate, float against, float truth, ChangeCounts& counts);

/// One pixel that has truth and a Reason.
void add_trust(float estimate, float truth, std::uint8_t reason, TrustCounts& counts);

/// Bad pixels and |error| in the order of the uncertainty, beside the oracle's order (Ilg et al., Poggi et al.).
DensityCounts count_density(const VideoFrame& frame);

/// A bit for each Region of a pixel that has truth. `before` and `motion` (current_from_previous) may be null.
cv::Mat find_regions(const VideoFrame& now, const VideoFrame* before, const Calibration* calibration,
                     const Eigen::Isometry3d* motion, float near_px);

}  // namespace egosgm::vision
