// SPDX-License-Identifier: Apache-2.0
#include "apps/sequence_arguments.h"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "egosgm/error.h"

namespace egosgm::app {
namespace {

constexpr const char* kGroup = "Input (one of)";

}  // namespace

void SequenceArguments::add_to(CLI::App& command) {
  add_sources(command);
  command
      .add_option("--dataset", folder,
                  "folder in the layout of KITTI odometry, KITTI raw or Middlebury, whichever it is")
      ->type_name("DIR")
      ->group(kGroup);
}

void SequenceArguments::add_to_with_positional(CLI::App& command) {
  command.add_option("DATASET", folder, "folder in the layout of KITTI odometry, KITTI raw or Middlebury")
      ->type_name("");
  add_sources(command);
}

void SequenceArguments::add_sources(CLI::App& command) {
  command
      .add_option("--odometry", odometry, "KITTI odometry sequence: image_0, image_1 (or image_2, image_3), calib.txt")
      ->type_name("DIR")
      ->group(kGroup);
  command
      .add_option("--kitti", kitti,
                  "KITTI 2012 or 2015 multi-view: `training`, `testing` or their parent; with --scene")
      ->type_name("DIR")
      ->group(kGroup);
  command.add_option("--scene", scene, "scene of --kitti, for example 000151")->type_name("NUMBER")->group(kGroup);
  command.add_option("--left", left, "left images: one PNG, or a pattern such as 'left/%06d.png' or 'left/*.png'")
      ->type_name("PATTERN")
      ->group(kGroup);
  command.add_option("--right", right, "right images, likewise; rectified")->type_name("PATTERN")->group(kGroup);
  command
      .add_option("--calib", calib,
                  "calibration of --left and --right: KITTI's, Middlebury's, or fx, fy, cx, cy, baseline_m")
      ->type_name("FILE")
      ->group(kGroup);
  command.add_option("--frames", frames, "frame numbers, both ends included: 7:10, 7:, :10 or 7; without: all")
      ->type_name("FIRST:LAST")
      ->group(kGroup);
}

vision::StereoSequence SequenceArguments::open() const {
  const bool patterns = !left.empty() || !right.empty() || !calib.empty();
  const int sources = !kitti.empty() + !odometry.empty() + !folder.empty() + patterns;
  if (sources != 1) {
    throw InvalidArgument(std::string(sources == 0 ? "no input" : "more than one input") +
                          ": give one of --odometry DIR, --kitti DIR --scene NUMBER, --left PATTERN --right PATTERN "
                          "--calib FILE, or a data set's folder");
  }
  if (kitti.empty() && !scene.empty()) throw InvalidArgument("--scene " + scene + ": give --kitti DIR with it");
  if (!kitti.empty() && scene.empty()) throw InvalidArgument("--kitti " + kitti + ": give --scene NUMBER with it");
  if (patterns && (left.empty() || right.empty() || calib.empty())) {
    throw InvalidArgument("--left, --right and --calib belong together: give all three");
  }
  const vision::FrameRange range = frames.empty() ? vision::FrameRange{} : vision::parse_frame_range(frames);
  if (!kitti.empty()) return vision::open_kitti_multiview(kitti, scene, range);
  if (!odometry.empty()) return vision::open_kitti_odometry(odometry, range);
  if (!folder.empty()) return vision::open_folder(folder, range);
  return vision::open_patterns(left, right, calib, range);
}

std::string SequenceArguments::text() const {
  std::string text;
  const auto append = [&](const char* name, const std::string& value) {
    if (value.empty()) return;
    const bool is_plain = std::all_of(value.begin(), value.end(), [](unsigned char c) {
      return std::isalnum(c) || std::string_view("/._-+=:,@%").find(static_cast<char>(c)) != std::string_view::npos;
    });
    std::string quoted = "'";
    for (const char c : value) quoted += c == '\'' ? "'\\''" : std::string(1, c);
    text += (text.empty() ? "" : " ") + std::string(name) + (is_plain ? value : quoted + "'");
  };
  append("", folder);
  append("--kitti ", kitti);
  append("--scene ", scene);
  append("--odometry ", odometry);
  append("--left ", left);
  append("--right ", right);
  append("--calib ", calib);
  append("--frames ", frames);
  return text;
}

}  // namespace egosgm::app
