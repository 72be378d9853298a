// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <future>
#include <optional>
#include <string>

#include "egosgm/export.h"
#include "egosgm/pipeline.h"
#include "vision/frame_source.h"
#include "vision/input_check.h"
#include "vision/motion_source.h"

namespace egosgm::vision {

/// A frame of a video and what was made of it. Of a pair that could not be read, `pair` alone is set.
struct VideoFrame {
  VideoPair pair;
  FrameMotion motion;
  FrameReport report;
  std::chrono::steady_clock::time_point read_start, odometry_start;
  double read_ms = 0;
};

struct StereoVideoOptions {
  std::optional<Calibration> calibration;  // of the images, where one is known
  // Asked once for each frame before it is matched: where its maps go. Their memory lives until the frame has come.
  std::function<FrameOutputs()> outputs;
  std::function<bool()> is_interrupted;  // asked before each pair of the source; empty: never
  bool reads_ahead = false;              // a thread reads the source and finds the motion while the caller works
  int lag = 1;  // pairs that are asked for before a frame comes, 1 or 0: with 1 the device works meanwhile
};

/// The one loop over a stereo video: takes pairs, finds their motion, keeps the pipeline busy, and gives the frames in
/// the order of their pairs.
///
/// - A pair that cannot be read costs itself alone: it comes at once, without maps, and the next motion spans the gap.
///   A video of which more than a half could not be read ends with InvalidArgument.
/// - Before a pair that starts anew, the pipeline and the odometry forget what they know.
/// - Whatever else fails ends the video, after the frames that were under way.
/// - An interrupt ends it like the last pair does. A pair that could not be read then is none.
///
/// Not thread-safe.
class EGOSGM_EXPORT StereoVideo {
 public:
  /// What is given outlives this object, and nobody else uses it meanwhile. `source`: null where the caller adds pairs.
  StereoVideo(MotionSource& motions, Pipeline& pipeline, StereoVideoOptions options, FrameSource* source = nullptr);
  /// Waits for frames under way, and drops them.
  ~StereoVideo();
  StereoVideo(const StereoVideo&) = delete;
  StereoVideo& operator=(const StereoVideo&) = delete;

  /// Without a source: whether the next frame needs another pair, which `add` takes. `end`: no more come, for the
  /// reason that `failure` says, if any.
  bool wants_pair() const { return !source_ && is_open(); }
  void add(VideoPair pair);
  void end(std::exception_ptr failure = nullptr);

  /// The next frame, or a pair that could not be read; none at the end. REQUIRES: !wants_pair(). Throws what failed.
  std::optional<VideoFrame> next();

  /// Whether an interrupt kept pairs from coming.
  bool is_complete() const;
  std::size_t left_out() const { return left_out_; }
  /// "1 of 4 pairs could not be read: " and why the first one could not.
  std::string text_of_left_out() const;
  /// What speaks against the input; empty where nothing does.
  std::string warning() const { return input_check_.text(); }
  /// What speaks against the poses that were given; empty where nothing does.
  std::string warning_of_poses() const;

 private:
  bool is_open() const { return !is_ended_ && !unreadable_ && static_cast<int>(under_way_.size()) <= options_.lag; }
  bool is_interrupted() const { return options_.is_interrupted && options_.is_interrupted(); }
  void ask_source();
  std::optional<VideoFrame> read();
  void find_motion(VideoFrame& frame);
  void take(VideoFrame frame);
  VideoFrame collect();
  void expect_enough() const;

  MotionSource& motions_;
  Pipeline& pipeline_;
  const StereoVideoOptions options_;
  FrameSource* const source_;
  InputCheck input_check_;
  const bool has_odometry_;
  std::deque<VideoFrame> under_way_;
  std::optional<VideoFrame> unreadable_;  // which comes next
  std::size_t pairs_ = 0, submitted_ = 0, left_out_ = 0;
  std::string first_left_out_, last_left_out_;  // why
  bool is_ended_ = false, is_source_at_end_ = false;
  std::exception_ptr failure_;  // what `next` throws at the end
  std::future<std::optional<VideoFrame>> ahead_;
};

}  // namespace egosgm::vision
