// SPDX-License-Identifier: Apache-2.0
#include "apps/sequence_arguments.h"

#include <CLI/App.hpp>
#include <algorithm>
#include <cctype>
#include <string_view>
#include <utility>

#include "apps/option_group.h"
#include "egosgm/error.h"
#include "egosgm/vision/calibration_io.h"
#include "vision/file_kinds.h"
#include "vision/folder_contents.h"
#include "vision/foreign_file.h"

namespace egosgm::app {
namespace {

/// A file, or what is none and has the marks of a pattern.
bool is_image(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error) && file.string().find_first_of("*%") != std::string::npos) return true;
  return !file.extension().empty() && std::filesystem::is_regular_file(file, error);
}

std::string refuse_pair(const std::string& first, const std::string& second) {
  std::error_code error;
  if (!std::filesystem::exists(first, error))
    return first + ": no such file; give the left and the right picture of a pair, two videos, or one folder";
  if (std::filesystem::is_directory(first, error) && std::filesystem::is_directory(second, error)) {
    return first + " and " + second + ": are two folders; give one of a stereo sequence, or of two cameras --left " +
           shell_word(first + "/*") + " --right " + shell_word(second + "/*") + " --calib FILE";
  }
  return "more than one input: " + first + " and " + second +
         ": give one folder, or the left and the right picture of a pair";
}

/// `options` that are given, as a shell takes them.
std::string words_of(const std::vector<std::pair<const char*, std::string>>& options) {
  std::string text;
  for (const auto& [name, value] : options) {
    if (!value.empty()) text += (text.empty() ? "" : " ") + std::string(name) + shell_word(value);
  }
  return text;
}

/// "name", "order" or empty. Throws InvalidArgument.
vision::PairBy parse_pair_by(const std::string& pair_by) {
  if (pair_by.empty() || pair_by == "name") return vision::PairBy::kName;
  if (pair_by == "order") return vision::PairBy::kOrder;
  throw InvalidArgument("--pair-by " + pair_by + ": choose name or order");
}

}  // namespace

void SequenceArguments::add_to(CLI::App& command) {
  const std::string heading = "Input (one of)";
  OptionGroup input(command, heading);
  input.add(
      "DATASET,--dataset", folder, "DIR",
      "folder in the layout of KITTI odometry, KITTI raw or Middlebury, whichever it is, or with left and right, or "
      "with a folder for each pair, or with left_1.png, right_1.png and so on; with their calib.txt, or with --calib");
  input.add("RIGHT", other_picture, "", "where DATASET is the left picture of a pair, or its pattern, the right one");
  input.add("--odometry", odometry, "DIR",
            "KITTI odometry sequence: image_0, image_1 (or image_2, image_3), calib.txt");
  input.add("--kitti", kitti, "DIR",
            "KITTI 2012 or 2015 multi-view: `training`, `testing` or their parent; with --scene");
  input.add("--scene", scene, "NUMBER", "scene of --kitti, for example 000151");
  input.add("--left", left, "PATTERN",
            "left images: one PNG or JPEG, or a pattern (in quotes) such as 'left/%06d.png' or 'left/*.jpg'");
  input.add("--right", right, "PATTERN", "right images, likewise; rectified");
  input.add("--calib", calib, "FILE",
            "calibration of --left and --right, or of a folder without one: KITTI's, Middlebury's, or fx, fy, cx, cy, "
            "baseline_m; with the "
            "Python package, of whichever program");
  input.add("--pair-by", pair_by, "name|order",
            "what tells which --left and --right images belong together: equal texts in their names (what * or "
            "%d stands for), or their order");
  input.add("--frames", frames, "FIRST:LAST", "frame numbers, both ends included: 7:10, 7:, :10 or 7; without: all");
}

std::optional<VideoArguments> SequenceArguments::videos() const {
  const bool is_pair = folder.empty() && other_picture.empty();
  const VideoArguments named = is_pair ? VideoArguments{left, right} : VideoArguments{folder, other_picture};
  if (!vision::is_video(named.left) || (is_pair && right.empty())) return std::nullopt;
  SequenceArguments others = *this;
  others.calib = others.frames = "";
  (is_pair ? others.left : others.folder).clear();
  (is_pair ? others.right : others.other_picture).clear();
  if (others.text().empty()) return named;
  throw InvalidArgument("more than one input: " + named.left + " and " + others.text() + ": give one of them");
}

std::optional<SequenceArguments> SequenceArguments::as_patterns() const {
  SequenceArguments patterns = *this;
  if (!other_picture.empty()) {
    if (!is_image(folder) || !left.empty() || !right.empty()) throw InvalidArgument(refuse_pair(folder, other_picture));
    patterns.left = std::exchange(patterns.folder, "");
    patterns.right = std::exchange(patterns.other_picture, "");
    return patterns;
  }
  if (folder.empty() || !left.empty() || !right.empty() || calib.empty()) return std::nullopt;
  const auto cameras = vision::find_two_cameras(folder);
  if (!cameras || !cameras->calibration.empty()) return std::nullopt;
  patterns.folder.clear();
  patterns.left = cameras->left, patterns.right = cameras->right;
  return patterns;
}

void SequenceArguments::expect_one_input(bool needs_calibration) const {
  const bool patterns = has_patterns();
  std::vector<std::string> sources;
  if (!kitti.empty()) sources.push_back("--kitti " + kitti);
  if (!odometry.empty()) sources.push_back("--odometry " + odometry);
  if (!folder.empty()) sources.push_back(folder);
  if (patterns) sources.push_back(words_of({{"--left ", left}, {"--right ", right}, {"--calib ", calib}}));
  if (sources.empty()) {
    throw InvalidArgument(
        "no input: give one of --odometry DIR, --kitti DIR --scene NUMBER, --left PATTERN --right PATTERN --calib "
        "FILE, or a data set's folder");
  }
  if (sources.size() > 1) {
    if (left.empty() && right.empty() && !calib.empty()) {
      throw InvalidArgument(
          "--calib " + calib + ": " + sources[0] +
          " is read with the calibration in it: put this one there, or give --left and --right with it");
    }
    const std::string hint = patterns && is_image(folder) ? "; did the shell expand a pattern? quote it: '*.png'" : "";
    throw InvalidArgument("more than one input: " + sources[0] + " and " + sources[1] + ": give one of them" + hint);
  }
  if (kitti.empty() && !scene.empty()) throw InvalidArgument("--scene " + scene + ": give --kitti DIR with it");
  if (!kitti.empty() && scene.empty()) throw InvalidArgument("--kitti " + kitti + ": give --scene NUMBER with it");
  if (patterns && (left.empty() || right.empty() || (needs_calibration && calib.empty()))) {
    throw InvalidArgument("--left, --right and --calib belong together: give all three");
  }
  parse_pair_by(pair_by);
  if (!pair_by.empty() && !patterns) {
    throw InvalidArgument("--pair-by " + pair_by + ": is for --left and --right; in a folder names tell");
  }
}

vision::StereoSequence SequenceArguments::open(bool needs_calibration, const CalibrationReader& read) const {
  if (const auto patterns = as_patterns()) return patterns->open(needs_calibration, read);
  expect_one_input(needs_calibration);
  const vision::FrameRange range = frames.empty() ? vision::FrameRange{} : vision::parse_frame_range(frames);
  if (!kitti.empty()) return vision::open_kitti_multiview(kitti, scene, range);
  if (!odometry.empty()) return vision::open_kitti_odometry(odometry, range);
  if (has_patterns()) return open_pictures(range, read);
  vision::StereoSequence sequence = vision::open_folder(folder, range);
  if (sequence.has_calibration || !needs_calibration) return sequence;
  throw InvalidArgument(folder + ": holds no calibration: put calib.txt there, or give --calib FILE");
}

vision::StereoSequence SequenceArguments::open_pictures(const vision::FrameRange& range,
                                                        const CalibrationReader& read) const {
  const vision::PairBy pairing = parse_pair_by(pair_by);
  std::string why_not;
  try {
    return vision::open_patterns(left, right, calib, range, pairing);
  } catch (const vision::NegativeBaseline&) {
    throw;
  } catch (const InvalidArgument& error) {
    std::error_code none;
    const bool is_stream = std::filesystem::is_fifo(calib, none) || std::filesystem::is_character_file(calib, none);
    if (calib.empty() || !read || is_stream) throw;  // a pipe can be read once
    if (!std::filesystem::exists(calib, none) || vision::is_own_calibration(calib)) throw;
    why_not = error.what();
  }
  vision::StereoSequence sequence = vision::open_patterns(left, right, "", range, pairing);
  const std::optional<Calibration> found = read(calib, vision::check_image_sizes(sequence), why_not);
  sequence.has_calibration = found.has_value();
  if (found) sequence.calibration = *found;
  return sequence;
}

void add_motion(CLI::App& command, std::string& poses_file, StereoOdometryOptions& options) {
  OptionGroup(command, "Method")
      .add("--poses", poses_file, "FILE",
           "take the motion from KITTI poses (camera-to-world) in place of stereo odometry");
  add_motion_bounds(command, options, "Method");
}

void add_motion_bounds(CLI::App& command, StereoOdometryOptions& options, const std::string& group) {
  OptionGroup bounds(command, group);
  bounds
      .add("--max-translation", options.max_translation_m, "M",
           "odometry: a longer motion between two frames is no motion [m]")
      ->capture_default_str();
  bounds
      .add("--max-rotation", options.max_rotation_deg, "DEG",
           "odometry: a larger turn between two frames is no motion [deg]")
      ->capture_default_str();
}

std::string shell_word(const std::string& text) {
  const bool is_plain = std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) || std::string_view("/._-+=:,@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (is_plain && !text.empty()) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

std::string SequenceArguments::text() const {
  return words_of({{"", folder},
                   {"", other_picture},
                   {"--kitti ", kitti},
                   {"--scene ", scene},
                   {"--odometry ", odometry},
                   {"--left ", left},
                   {"--right ", right},
                   {"--calib ", calib},
                   {"--pair-by ", pair_by},
                   {"--frames ", frames}});
}

void BagArguments::add_to(CLI::App& command) {
  OptionGroup options(command, "Bags, by the Python package with its extra \"bag\"");
  options.add("--bag", bag, "BAG", "ROS 2 (MCAP, SQLite) or ROS 1: a .mcap, a .bag, or a bag's folder");
  const auto add = [&](const char* name, auto& value, const char* text, const char* type) {
    return others_.emplace_back(options.add(name, value, type, text));
  };
  add("--left-topic", left_topic, "raw or compressed images [where names tell, and there is one choice, that one]",
      "TOPIC");
  add("--right-topic", right_topic, "", "TOPIC");
  add("--info-topics", info_topics, "camera infos, left and right [camera_info beside the images]", "TOPIC TOPIC")
      ->expected(2);
  add("--pose-topic", pose_topic, "motion from there (Odometry, PoseStamped) in place of stereo odometry", "TOPIC");
  add("--pose-axes", pose_axes, "of the poses: x forward, z up, or z forward, y down [body]", "body|optical");
  add("--max-skew-ms", max_skew_ms, "how far the stamps of a pair may differ [0]", "MS");
  add("--rectify", rectify,
      "images by their infos [auto: where the infos have a distortion and the topic is not named rect]", "auto|on|off");
}

std::string BagArguments::option_without_bag() const {
  if (!bag.empty()) return {};
  const auto given =
      std::find_if(others_.begin(), others_.end(), [](const auto* option) { return option->count() > 0; });
  return given == others_.end() ? "" : (*given)->get_name();
}

std::string BagArguments::text() const {
  const bool has_infos = !info_topics.empty();
  return words_of({{"--bag ", bag},
                   {"--left-topic ", left_topic},
                   {"--right-topic ", right_topic},
                   {"--info-topics ", has_infos ? info_topics[0] : ""},
                   {"", has_infos ? info_topics[1] : ""}});
}

}  // namespace egosgm::app
