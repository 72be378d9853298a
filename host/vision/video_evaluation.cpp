// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/video_evaluation.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <string>
#include <thread>

#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "host/vision/disparity_error.h"
#include "host/vision/video_metrics.h"

namespace egosgm::vision {
namespace {

constexpr int kFramesAtOnce = 16;  // that a thread takes; it reads one more, the frame before

/// A frame with what more than one figure needs of it.
struct Prepared {
  VideoFrame frame;
  cv::Mat filled;
};

std::string size_of(const cv::Mat& map) { return std::to_string(map.cols) + "x" + std::to_string(map.rows); }

void require(const cv::Mat& map, int type, const char* name, const VideoFrame& frame, int number) {
  if (map.empty()) return;
  if (map.type() != type) {
    throw InvalidArgument("frame " + std::to_string(number) + ": " + name + " has the wrong type of pixels");
  }
  if (map.size() != frame.estimate.size()) {
    throw InvalidArgument("frame " + std::to_string(number) + ": the estimate is " + size_of(frame.estimate) + ", " +
                          name + " " + size_of(map) + "; give maps of one size");
  }
}

Prepared read(const Video& video, int number) {
  Prepared result{video.read(number), {}};
  const VideoFrame& frame = result.frame;
  if (frame.estimate.empty()) throw InvalidArgument("frame " + std::to_string(number) + ": the estimate is empty");
  require(frame.estimate, CV_32FC1, "the estimate", frame, number);
  require(frame.truth, CV_32FC1, "the truth", frame, number);
  require(frame.all_truth, CV_32FC1, "the truth of all pixels", frame, number);
  require(frame.against, CV_32FC1, "the other estimate", frame, number);
  require(frame.uncertainty, CV_32FC1, "the uncertainty", frame, number);
  require(frame.next_truth, CV_32FC1, "the next frame's truth", frame, number);
  require(frame.flow_to_next, CV_32FC2, "the flow", frame, number);
  require(frame.reason, CV_8UC1, "the reasons", frame, number);
  require(frame.moving, CV_8UC1, "the mask of what moves", frame, number);
  require(frame.image, frame.image.depth() == CV_16U ? CV_16UC1 : CV_8UC1, "the image", frame, number);
  if (!frame.truth.empty()) result.filled = interpolate_background(frame.estimate);
  return result;
}

/// DynamicStereo's TEPE at one pixel, where it and the frame before have truth.
void add_tepe(const Prepared& before, const Prepared& now, int y, int x, RegionCounts& counts) {
  const auto at = [&](const cv::Mat& map) { return map.at<float>(y, x); };
  const auto change = [&](const cv::Mat& map_before, const cv::Mat& map) {
    return static_cast<double>(at(map_before)) - at(map);
  };
  const auto have = [&](const cv::Mat& a, const cv::Mat& b) {
    return is_valid_disparity(at(a)) && is_valid_disparity(at(b));
  };
  if (before.frame.truth.empty() || !have(before.frame.truth, now.frame.truth)) return;
  const double true_change = change(before.frame.truth, now.frame.truth);
  if (have(before.frame.estimate, now.frame.estimate)) {
    add_change_error(change(before.frame.estimate, now.frame.estimate), true_change, counts.tepe);
  }
  if (have(before.filled, now.filled)) {
    add_change_error(change(before.filled, now.filled), true_change, counts.tepe_interpolated);
  }
}

void count_regions(const Prepared* before, const Prepared& now, const cv::Mat& regions, VideoCounts& counts) {
  const VideoFrame& frame = now.frame;
  for (int y = 0; y < regions.rows; ++y) {
    for (int x = 0; x < regions.cols; ++x) {
      const std::uint8_t bits = regions.at<std::uint8_t>(y, x);
      if (bits == 0) continue;
      const float truth = frame.truth.at<float>(y, x), estimate = frame.estimate.at<float>(y, x);
      for (std::size_t r = 0; r < counts.regions.size(); ++r) {
        if (!(bits >> r & 1U)) continue;
        count_pixel(estimate, now.filled.at<float>(y, x), truth, counts.regions[r].errors);
        if (!frame.against.empty()) {
          add_change(estimate, frame.against.at<float>(y, x), truth, counts.regions[r].against);
        }
        if (!frame.reason.empty()) {
          add_trust(estimate, truth, frame.reason.at<std::uint8_t>(y, x), counts.regions[r].trust);
        }
        if (before) add_tepe(*before, now, y, x, counts.regions[r]);
      }
    }
  }
  for (RegionCounts& region : counts.regions) {
    end_pair(region.tepe);
    end_pair(region.tepe_interpolated);
  }
}

void count_warps(const VideoFrame& before, const VideoFrame& now, const Calibration& calibration,
                 const Eigen::Isometry3d& motion, VideoCounts& counts) {
  const cv::Mat moved = move_map(before.estimate, calibration, motion);
  const cv::Mat moved_back = move_map(now.estimate, calibration, motion.inverse());
  counts.flicker += count_flicker(now.estimate, moved);
  counts.tae_percent += temporal_alignment_error(now.estimate, moved, calibration.doffs_px);
  counts.tae_percent += temporal_alignment_error(before.estimate, moved_back, calibration.doffs_px);
  if (!before.flow_to_next.empty() || before.truth.empty() || now.truth.empty()) return;
  counts.tepe_along_motion += tepe_along_poses(before, now, PixelMotion(calibration, motion, now.estimate.size()));
}

/// Of frame `number`, and of the pair with the one before, which is null where there is none.
VideoCounts count_frame(const Video& video, const Prepared* before, const Prepared& now, int number, float near_px) {
  VideoCounts counts;
  std::optional<Eigen::Isometry3d> motion;
  if (before && video.calibration && video.current_from_previous) motion = video.current_from_previous(number);
  if (!now.frame.truth.empty()) {
    const cv::Mat regions =
        find_regions(now.frame, before ? &before->frame : nullptr, video.calibration ? &*video.calibration : nullptr,
                     motion ? &*motion : nullptr, near_px);
    count_regions(before, now, regions, counts);
    if (!now.frame.uncertainty.empty()) counts.density = count_density(now.frame);
  }
  if (!before) return counts;
  if (motion) count_warps(before->frame, now.frame, *video.calibration, *motion, counts);
  if (!before->frame.flow_to_next.empty()) {
    if (!before->frame.truth.empty()) counts.tepe_along_motion += tepe_along_flow(before->frame, now.frame);
    add_flow_figures(before->frame, now.frame, video.calibration, counts);
  }
  return counts;
}

/// Hands out frames to threads, and keeps the first error.
class Work {
 public:
  Work(const Video& video, const VideoEvaluationOptions& options, const std::function<void(int)>& done, int at_once)
      : video_(video), options_(options), done_(done), at_once_(at_once), counts_(video.frames) {}

  void run() {
    for (int first = next_.fetch_add(at_once_); first < video_.frames && !failed_; first = next_.fetch_add(at_once_)) {
      run_frames(first, std::min(first + at_once_, video_.frames));
    }
  }

  std::vector<VideoCounts> take() {
    if (error_) std::rethrow_exception(error_);
    return std::move(counts_);
  }

 private:
  void run_frames(int first, int end) {
    int i = first;
    try {
      std::optional<Prepared> before;
      if (first > 0 && follows(first)) before = read(video_, first - 1);
      for (; i < end && !failed_; ++i) {
        Prepared now = read(video_, i);
        const bool is_pair = before && follows(i);
        if (is_pair && before->frame.estimate.size() != now.frame.estimate.size()) {
          throw InvalidArgument("frame " + std::to_string(i) + ": the estimate is " + size_of(now.frame.estimate) +
                                ", that of the frame before " + size_of(before->frame.estimate) +
                                "; give maps of one size");
        }
        counts_[i] = count_frame(video_, is_pair ? &*before : nullptr, now, i, options_.near_px);
        before = std::move(now);
        if (done_) {
          const std::lock_guard lock(mutex_);
          done_(i);
        }
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      if (!error_ || i < failed_frame_) {
        error_ = std::current_exception();
        failed_frame_ = i;
      }
      failed_ = true;
    }
  }

  bool follows(int i) const { return i > 0 && (!video_.follows || video_.follows(i)); }

  const Video& video_;
  const VideoEvaluationOptions& options_;
  const std::function<void(int)>& done_;
  const int at_once_;
  std::vector<VideoCounts> counts_;
  std::atomic<int> next_ = 0;
  std::atomic<bool> failed_ = false;
  std::mutex mutex_;  // of what follows
  std::exception_ptr error_;
  int failed_frame_ = 0;
};

}  // namespace

VideoEvaluation evaluate_video(const Video& video, const VideoEvaluationOptions& options,
                               const std::function<void(int)>& done) {
  if (video.frames < 1 || !video.read) throw InvalidArgument("evaluate_video: no frames: give at least one");
  if (video.calibration) video.calibration->validate();
  const int wanted = options.threads > 0 ? options.threads : static_cast<int>(std::thread::hardware_concurrency());
  const int threads = std::clamp(wanted, 1, video.frames);
  Work work(video, options, done, std::clamp(video.frames / threads, 1, kFramesAtOnce));
  std::vector<std::jthread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back([&work] { work.run(); });
  work.run();
  others.clear();
  VideoEvaluation result{.frames = work.take(), .total = {}};
  for (const VideoCounts& frame : result.frames) result.total += frame;
  return result;
}

}  // namespace egosgm::vision
