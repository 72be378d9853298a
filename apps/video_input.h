// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <future>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "apps/estimate_reader.h"
#include "apps/truth_pairs.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/video_evaluation.h"
#include "host/vision/pair_with_truth.h"

namespace egosgm::app {

/// What `eval` is given beside estimate and truth.
struct VideoArguments {
  std::string mask, sequence, scene, poses, against, variance, confidence, moving, flow, next_truth;
  double scale = 256, truth_scale = 256;

  void add_to(CLI::App& command);
};

/// The files of one frame; empty where there is none.
struct FrameFiles {
  FrameFiles(std::string its_name, std::filesystem::path its_estimate)
      : name(std::move(its_name)), estimate(std::move(its_estimate)) {}

  std::string name;
  std::filesystem::path estimate, truth, all_truth, against, reason, uncertainty, moving, image, flow, next_truth, mask;
};

/// The motions of a stereo sequence by odometry, found on a thread of its own while others wait for those they need.
class OdometryMotions {
 public:
  OdometryMotions(const vision::StereoSequence& sequence, int first, int last);

  /// From frame number `from` of the sequence to `to`. None where odometry found none. Waits. Thread-safe.
  std::optional<Eigen::Isometry3d> between(int from, int to) const;

 private:
  using Motion = std::optional<Eigen::Isometry3d>;

  void run(const std::stop_token& stop, const vision::StereoSequence& sequence, int first, int last);

  int first_;
  std::vector<std::promise<Motion>> promises_;
  std::vector<std::shared_future<Motion>> motions_;  // to frame first_ + i
  std::jthread thread_;                              // the last member: it uses the others
};

/// Estimates with everything that belongs to them, as vision::evaluate_video takes it.
class VideoInput {
 public:
  /// Pairs the files; images and maps are read later. Throws InvalidArgument.
  VideoInput(const ComparisonArguments& compared, const VideoArguments& arguments);

  /// Uses this object, which must outlive it.
  vision::Video video() const;

  const std::vector<FrameFiles>& frames() const { return frames_; }
  /// Frames that follow one another.
  int successors() const;
  /// Estimates and their truth; no pairs where there is no truth.
  const vision::EvaluationPairs& truth_pairs() const { return truth_pairs_; }
  /// "poses FILE", "odometry", or empty.
  const std::string& motion_source() const { return motion_source_; }
  /// What speaks against the estimates that were read.
  std::vector<std::string> doubts() const { return estimates_.doubts(arguments_.scale); }

 private:
  void list_frames(const ComparisonArguments& compared);
  void pair(const std::string& folder, const char* inside, std::filesystem::path FrameFiles::*member);
  void find_reasons();
  void open_sequence();
  void open_motions();
  vision::VideoFrame read(int i) const;

  const VideoArguments& arguments_;
  const std::string number_range_;
  std::vector<FrameFiles> frames_;
  std::vector<bool> follows_;
  vision::EvaluationPairs truth_pairs_;
  std::optional<vision::StereoSequence> sequence_;
  std::vector<int> in_sequence_;  // place of each frame
  std::vector<Eigen::Isometry3d> poses_;
  std::optional<OdometryMotions> odometry_;
  std::string motion_source_;
  mutable EstimateReader estimates_;
};

}  // namespace egosgm::app
