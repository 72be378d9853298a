// SPDX-License-Identifier: Apache-2.0
#include "apps/video_input.h"

#include <fmt/core.h>

#include <algorithm>
#include <map>

#include "egosgm/error.h"
#include "egosgm/odometry.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/opencv.h"
#include "egosgm/vision/poses_io.h"
#include "host/vision/flow_io.h"
#include "host/vision/frame_names.h"
#include "host/vision/pair_with_truth.h"
#include "host/vision/video_order.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

constexpr const char* kGroup = "Over time";

/// The folder inside, where there is one: OUT/disparity of OUT.
fs::path folder_in(const fs::path& folder, const char* inside) {
  return *inside != '\0' && is_directory(folder / inside) ? folder / inside : folder;
}

/// Reads one map of a frame with `reader`, checks its size, and names both files where it does not fit.
template <typename Reader>
cv::Mat read_map(const fs::path& file, const vision::VideoFrame& frame, const fs::path& estimate, Reader&& reader) {
  if (file.empty()) return {};
  const cv::Mat map = reader(file);
  if (map.size() != frame.estimate.size()) {
    throw InvalidArgument(fmt::format("{} is {}x{}, {} is {}x{}: give maps of one size", estimate.string(),
                                      frame.estimate.cols, frame.estimate.rows, file.string(), map.cols, map.rows));
  }
  return map;
}

/// Where a sequence of this program's or the rendered videos keeps the mask of what moves by itself.
std::string moving_masks_of(const fs::path& sequence) {
  for (const char* place : {"truth/left_moving", "truth/moving"}) {
    if (is_directory(sequence / place)) return (sequence / place).string();
  }
  return {};
}

}  // namespace

void VideoArguments::add_to(CLI::App& command) {
  command
      .add_option("--mask", mask,
                  "compare only where this grey PNG, or the one of the truth's name in this folder, is not 0")
      ->type_name("FILE|DIR");
  command.add_option("--scale", scale, "steps a pixel of 16-bit PNG in --estimate and --against; KITTI's have 256")
      ->type_name("STEPS")
      ->capture_default_str();
  command.add_option("--truth-scale", truth_scale, "the same of the truth")->type_name("STEPS")->capture_default_str();
  const auto add = [&](const char* name, std::string& value, const char* help, const char* type = "DIR") {
    command.add_option(name, value, help)->type_name(type)->group(kGroup);
  };
  add("--sequence", sequence,
      "the stereo sequence that the maps are of (KITTI odometry or raw, egosgm synth, with --scene KITTI multi-view): "
      "calibration, poses, images, and truth where --truth is not given");
  add("--scene", scene, "scene of --sequence, for example 000151", "NUMBER");
  add("--poses", poses, "KITTI poses of --sequence, in place of its own; without any: stereo odometry", "FILE");
  add("--against", against,
      "another method's maps: what was changed for the worse and for the better, what was gained and what was lost");
  add("--variance", variance, "a map per frame that grows with the expected error (PFM, .npy, grey PNG)");
  add("--confidence", confidence, "a map per frame that falls with the expected error");
  add("--moving", moving, "masks of what moves by itself, not 0; without: those in --sequence");
  add("--flow", flow, "true optical flow from each frame to the next (KITTI PNG, .flo)");
  add("--next-truth", next_truth, "the next frame's true disparity at each frame's pixels (KITTI 2015: disp_occ_1)");
}

OdometryMotions::OdometryMotions(const vision::StereoSequence& sequence, int first, int last)
    : first_(first), promises_(last - first + 1) {
  for (auto& promise : promises_) motions_.push_back(promise.get_future().share());
  thread_ =
      std::jthread([this, &sequence, first, last](const std::stop_token& stop) { run(stop, sequence, first, last); });
}

void OdometryMotions::run(const std::stop_token& stop, const vision::StereoSequence& sequence, int first, int last) {
  int i = first;
  try {
    StereoOdometry odometry(sequence.calibration);
    for (; i <= last && !stop.stop_requested(); ++i) {
      const vision::StereoImages images = vision::read_images(sequence.frames[i]);
      const auto motion = odometry.process(vision::image_view(images.left), vision::image_view(images.right)).motion;
      promises_[i - first].set_value(motion ? Motion(motion->current_from_previous) : std::nullopt);
    }
  } catch (...) {
    for (; i <= last; ++i) promises_[i - first].set_exception(std::current_exception());
  }
}

std::optional<Eigen::Isometry3d> OdometryMotions::between(int from, int to) const {
  Motion result = Eigen::Isometry3d::Identity();
  for (int i = from + 1; i <= to; ++i) {
    const Motion& motion = motions_.at(i - first_).get();
    if (!motion) return std::nullopt;
    result = *motion * *result;
  }
  return result;
}

VideoInput::VideoInput(const ComparisonArguments& compared, const VideoArguments& arguments)
    : arguments_(arguments), number_range_(compared.frames) {
  if (!arguments.variance.empty() && !arguments.confidence.empty()) {
    throw InvalidArgument("--variance and --confidence: give one of them");
  }
  if (arguments.sequence.empty() && (!arguments.poses.empty() || !arguments.scene.empty())) {
    throw InvalidArgument("--poses and --scene belong to a sequence: give --sequence DIR with them");
  }
  list_frames(compared);
  find_reasons();
  pair(arguments.against, "disparity", &FrameFiles::against);
  pair(arguments.variance, "variance", &FrameFiles::uncertainty);
  pair(arguments.confidence, "", &FrameFiles::uncertainty);
  pair(arguments.flow, "", &FrameFiles::flow);
  pair(arguments.next_truth, "", &FrameFiles::next_truth);
  if (!arguments.sequence.empty()) open_sequence();
  pair(!arguments.moving.empty() || arguments.sequence.empty() ? arguments.moving : moving_masks_of(arguments.sequence),
       "", &FrameFiles::moving);
  for (const FrameFiles& frame : frames_) {
    expect_scaled("--scale", arguments.scale, frame.estimate);
    expect_scaled("--truth-scale", arguments.truth_scale, frame.truth);
  }
}

/// Every estimate, with its truth where it has one.
void VideoInput::list_frames(const ComparisonArguments& compared) {
  const auto all_maps = [&] {
    return vision::list_maps(
        compared.estimate, compared.frames.empty() ? vision::FrameRange{} : vision::parse_frame_range(compared.frames));
  };
  if (compared.truth.empty()) {
    truth_pairs_.without_truth = all_maps();
  } else {
    truth_pairs_ = find_truth_pairs(compared.estimate, compared.truth, compared.frames);
    if (!arguments_.sequence.empty() && !is_directory(fs::path(compared.truth))) {
      // One truth file: the frames around it are measured over time all the same.
      truth_pairs_.without_truth = all_maps();
      std::erase(truth_pairs_.without_truth, truth_pairs_.pairs.front().estimate);
    }
  }
  for (const vision::EvaluationPair& pair : truth_pairs_.pairs) {
    FrameFiles& frame = frames_.emplace_back(pair.name, pair.estimate);
    frame.truth = pair.truth;
    if (arguments_.mask.empty()) continue;
    const fs::path mask = arguments_.mask;
    frame.mask = is_directory(mask) ? mask / pair.truth.filename().replace_extension(".png") : mask;
  }
  for (const fs::path& estimate : truth_pairs_.without_truth) {
    frames_.emplace_back(estimate.stem().string(), estimate);
  }
  std::sort(frames_.begin(), frames_.end(),
            [](const FrameFiles& a, const FrameFiles& b) { return vision::is_before(a.name, b.name); });
  std::vector<std::string> names;
  for (const FrameFiles& frame : frames_) names.push_back(frame.name);
  follows_ = vision::find_successors(names);
}

void VideoInput::pair(const std::string& folder, const char* inside, fs::path FrameFiles::*member) {
  if (folder.empty()) return;
  const fs::path estimates = frames_.size() == 1 ? frames_.front().estimate : frames_.front().estimate.parent_path();
  std::map<std::string, fs::path> files;
  for (const auto& pair : find_truth_pairs(estimates, folder_in(folder, inside), number_range_).pairs) {
    files[pair.name] = pair.truth;
  }
  for (FrameFiles& frame : frames_) {
    if (const auto file = files.find(frame.name); file != files.end()) frame.*member = file->second;
  }
}

/// Those that `egosgm run` wrote beside its maps.
void VideoInput::find_reasons() {
  for (FrameFiles& frame : frames_) {
    const fs::path run = frame.estimate.parent_path() / "..";
    const fs::path file = run / "reason" / (frame.estimate.stem().string() + ".png");
    if (is_regular_file(run / "report.json") && is_regular_file(file)) frame.reason = file;
  }
}

void VideoInput::open_sequence() {
  const std::string& folder = arguments_.sequence;
  sequence_ =
      arguments_.scene.empty() ? vision::open_folder(folder) : vision::open_kitti_multiview(folder, arguments_.scene);
  std::map<int, int> place;  // of a frame's number
  for (std::size_t i = 0; i < sequence_->frames.size(); ++i) place[sequence_->frames[i].number] = static_cast<int>(i);
  for (FrameFiles& frame : frames_) {
    const auto number = vision::frame_number(frame.name);
    const auto found = number ? place.find(*number) : place.end();
    if (found == place.end()) {
      throw InvalidArgument(fmt::format("{}: {} has no frame of this number; it has {} to {}", frame.estimate.string(),
                                        folder, sequence_->frames.front().number, sequence_->frames.back().number));
    }
    in_sequence_.push_back(found->second);
    const vision::StereoFrame& stereo = sequence_->frames[found->second];
    if (!frame.flow.empty()) frame.image = stereo.left;
    if (!frame.truth.empty()) frame.all_truth = stereo.truth_occ;
  }
  if (successors() > 0) open_motions();
}

void VideoInput::open_motions() {
  const fs::path file = arguments_.poses.empty() ? sequence_->poses_file : fs::path(arguments_.poses);
  if (file.empty()) {
    const auto [first, last] = std::minmax_element(in_sequence_.begin(), in_sequence_.end());
    odometry_.emplace(*sequence_, *first, *last);
    motion_source_ = "odometry";
  } else {
    poses_ = vision::poses_of_frames(*sequence_, file);
    motion_source_ = "poses " + file.string();
  }
}

int VideoInput::successors() const { return static_cast<int>(std::count(follows_.begin(), follows_.end(), true)); }

vision::Video VideoInput::video() const {
  vision::Video video;
  video.frames = static_cast<int>(frames_.size());
  video.read = [this](int i) { return read(i); };
  video.follows = [this](int i) { return follows_[i]; };
  if (!sequence_) return video;
  video.calibration = sequence_->calibration;
  video.current_from_previous = [this](int i) -> std::optional<Eigen::Isometry3d> {
    const int before = in_sequence_[i - 1], now = in_sequence_[i];
    if (odometry_) return odometry_->between(before, now);
    if (poses_.empty()) return std::nullopt;
    return vision::current_from_previous(poses_[before], poses_[now]);
  };
  return video;
}

vision::VideoFrame VideoInput::read(int i) const {
  const FrameFiles& files = frames_[i];
  vision::VideoFrame frame;
  const auto disparity = [](double scale) {
    return [scale](const fs::path& file) { return read_scaled(file, scale); };
  };
  const auto read_into = [&](const fs::path& file, auto&& reader) {
    return read_map(file, frame, files.estimate, reader);
  };
  frame.estimate = estimates_.read(files.estimate, arguments_.scale);
  frame.truth = read_into(files.truth, disparity(arguments_.truth_scale));
  estimates_.compare(frame.estimate, frame.truth);
  frame.all_truth = read_into(files.all_truth, disparity(256));
  frame.against =
      read_into(files.against, [&](const fs::path& file) { return estimates_.read(file, arguments_.scale); });
  frame.next_truth = read_into(files.next_truth, disparity(arguments_.truth_scale));
  frame.reason = read_into(files.reason, vision::read_grey_image);
  frame.uncertainty = read_into(files.uncertainty, vision::read_values);
  if (!arguments_.confidence.empty() && !frame.uncertainty.empty()) frame.uncertainty *= -1;
  const cv::Mat moving = read_into(files.moving, vision::read_grey_image);
  if (!moving.empty()) frame.moving = moving != 0;
  frame.image = read_into(files.image, vision::read_grey_image);
  frame.flow_to_next = read_into(files.flow, vision::read_flow);
  const cv::Mat kept = read_into(files.mask, vision::read_grey_image);
  if (!kept.empty()) frame.truth.setTo(kInvalidDisparity, kept == 0);
  return frame;
}

}  // namespace egosgm::app
