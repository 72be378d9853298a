// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "apps/cli_names.h"
#include "egosgm/odometry.h"
#include "egosgm/vision/dataset.h"

namespace egosgm::app {

/// Reads the calibration of a file that this library does not, for `why_not`, and images of `size`; none where it is of
/// raw images, which the caller rectifies. Throws InvalidArgument.
using CalibrationReader =
    std::function<std::optional<Calibration>(const std::string& file, vision::Size size, const std::string& why_not)>;

/// The videos of both cameras, or one of both views, whose `right` is empty.
struct VideoArguments {
  std::string left, right;
};

/// The arguments that say which stereo sequence to read.
struct SequenceArguments {
  std::string kitti, scene, odometry, folder, other_picture, left, right, calib, pair_by, frames;

  void add_to(CLI::App& command);
  /// Throws InvalidArgument unless exactly one sequence was named, and as the openers do, and where the sequence has no
  /// calibration and `needs_calibration`. `read`: for calibrations of other programs, where somebody reads them.
  vision::StereoSequence open(bool needs_calibration = true, const CalibrationReader& read = {}) const;
  /// The videos that are named in place of a sequence; none where it is no video.
  std::optional<VideoArguments> videos() const;
  /// The arguments, as a shell takes them for any command that reads a sequence.
  std::string text() const;

 private:
  bool has_patterns() const { return !left.empty() || !right.empty() || !calib.empty(); }
  /// The two pictures, or the two cameras' folders that lie in `folder`, as --left and --right; none where there are
  /// none.
  std::optional<SequenceArguments> as_patterns() const;
  /// Throws InvalidArgument unless the options that are given belong together and name one sequence.
  void expect_one_input(bool needs_calibration) const;
  vision::StereoSequence open_pictures(const vision::FrameRange& range, const CalibrationReader& read) const;
};

/// The arguments of a drive that ROS recorded, which the Python package reads.
struct BagArguments {
  std::string bag, left_topic, right_topic, pose_topic, pose_axes = "body", max_skew_ms = "0", rectify = "auto";
  std::vector<std::string> info_topics;

  void add_to(CLI::App& command);
  /// An option of a bag that was given without one; else empty.
  std::string option_without_bag() const;
  /// See SequenceArguments::text.
  std::string text() const;

 private:
  std::vector<CLI::Option*> others_;  // than --bag
};

/// Adds --poses, --max-translation and --max-rotation to the group "Method".
void add_motion(CLI::App& command, std::string& poses_file, StereoOdometryOptions& options);

/// Adds --max-translation and --max-rotation.
void add_motion_bounds(CLI::App& command, StereoOdometryOptions& options, const std::string& group);

/// `text` as a word of a shell's command.
std::string shell_word(const std::string& text);

}  // namespace egosgm::app
