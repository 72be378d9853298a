// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/plot_file.h"
#include "apps/run_folder.h"
#include "apps/truth_pairs.h"
#include "egosgm/error.h"
#include "egosgm/vision/pose_evaluation.h"
#include "egosgm/vision/poses_io.h"
#include "host/vision/pose_plot.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
constexpr double kDegrees = 180.0 / 3.14159265358979323846;

struct EvalPosesArguments {
  ComparisonArguments compared;
  std::vector<std::string> plots;
  bool json = false;
};

Json json_of(const vision::PoseEvaluation& e) {
  Json json{{"frames", e.motions.size() + 1},
            {"path_length_m", e.path_length_m},
            {"translation_mean_m", e.translation_mean_m},
            {"rotation_mean_deg", e.rotation_mean_rad * kDegrees},
            {"translation_rmse_m", e.translation_rmse_m},
            {"rotation_rmse_deg", e.rotation_rmse_rad * kDegrees},
            {"end_drift_m", e.end_drift_m},
            {"end_drift_percent", e.end_drift_percent},
            {"rotation_end_drift_deg", e.rotation_end_drift_deg},
            {"short_segments", e.short_segments},
            {"segment_translation_percent", e.segment_translation_percent},
            {"segment_rotation_deg_per_m", e.segment_rotation_deg_per_m},
            {"segments", Json::array()},
            {"motions", Json::array()}};
  for (const vision::SegmentError& segment : e.segments) {
    json["segments"].push_back({{"length_m", segment.length_m},
                                {"segments", segment.segments},
                                {"translation_percent", segment.translation_percent},
                                {"rotation_deg_per_m", segment.rotation_deg_per_m}});
  }
  for (const vision::RelativePoseError& motion : e.motions) {
    json["motions"].push_back(
        {{"translation_m", motion.translation_m}, {"rotation_deg", motion.rotation_rad * kDegrees}});
  }
  return json;
}

void print(const vision::PoseEvaluation& e) {
  fmt::print("{}, {:.1f} m\n", counted(e.motions.size() + 1, "frame"), e.path_length_m);
  fmt::print("frame to frame   {:.4f} m  {:.4f} deg (mean), {:.4f} m  {:.4f} deg (root mean square)\n",
             e.translation_mean_m, e.rotation_mean_rad * kDegrees, e.translation_rmse_m,
             e.rotation_rmse_rad * kDegrees);
  const bool moved = std::isfinite(e.end_drift_percent);
  fmt::print("at the end       {:.3f} m = {} %  {:.3f} deg\n", e.end_drift_m,
             moved ? fmt::format("{:.3f}", e.end_drift_percent) : "-", e.rotation_end_drift_deg);
  if (e.segments.empty()) return;
  fmt::print("segments         {:.3f} %  {:.5f} deg/m{}\n", e.segment_translation_percent, e.segment_rotation_deg_per_m,
             e.short_segments ? " (of 5 to 50 m: not comparable with KITTI's of 100 to 800 m)" : "");
  for (const vision::SegmentError& segment : e.segments) {
    fmt::print("{:8.0f} m {:6d}  {:.3f} %  {:.5f} deg/m\n", segment.length_m, segment.segments,
               segment.translation_percent, segment.rotation_deg_per_m);
  }
}

using Poses = std::vector<Eigen::Isometry3d>;

/// A file of poses: itself, a run's, or a data set's true ones.
fs::path poses_file_of(const fs::path& path, vision::StereoSequence* whole) {
  if (!fs::is_directory(path)) return path;
  if (fs::is_regular_file(path / "report.json") && fs::is_regular_file(path / "poses.txt")) return path / "poses.txt";
  vision::StereoSequence sequence = vision::open_folder(path);
  if (sequence.poses_file.empty()) throw InvalidArgument(path.string() + ": holds no poses.txt; give a file of poses");
  if (whole) *whole = sequence;
  return sequence.poses_file;
}

std::vector<int> counted_from_0(std::size_t count) {
  std::vector<int> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

/// Frames without images: their numbers alone.
vision::StereoSequence numbered(const std::vector<int>& numbers) {
  vision::StereoSequence sequence;
  for (const int number : numbers) sequence.frames.emplace_back().number = number;
  return sequence;
}

/// The estimate and the truth of the same frames.
struct PosePairs {
  Poses estimate, truth;
};

PosePairs read_pairs(const ComparisonArguments& compared) {
  vision::StereoSequence whole;
  const fs::path estimate_file = poses_file_of(compared.estimate, nullptr);
  const fs::path truth_file = poses_file_of(compared.truth, &whole);
  const Poses estimate = vision::read_poses(estimate_file), truth = vision::read_poses(truth_file);
  const vision::FrameRange chosen =
      compared.frames.empty() ? vision::FrameRange{} : vision::parse_frame_range(compared.frames);
  const auto is_chosen = [&](int number) {
    return number >= chosen.first.value_or(number) && number <= chosen.last.value_or(number);
  };
  // Which frames the estimate's rows are of: the run tells, or --frames where they are as many, or they are all.
  std::optional<vision::StereoSequence> frames = frames_of_run(estimate_file);
  if (!frames || frames->frames.size() != estimate.size()) {
    std::vector<int> all = whole.numbers, some;
    if (all.empty()) all = counted_from_0(truth.size());
    std::copy_if(all.begin(), all.end(), std::back_inserter(some), is_chosen);
    if (!compared.frames.empty() && some.size() == estimate.size()) {
      frames = numbered(some);
    } else if (estimate.size() == truth.size()) {
      frames = numbered(all.size() == estimate.size() ? all : counted_from_0(estimate.size()));
    } else {
      throw InvalidArgument(
          fmt::format("{} holds {}, {} {}: give --frames FIRST:LAST, the numbers of the estimate's frames",
                      estimate_file.string(), counted(estimate.size(), "pose"), truth_file.string(), truth.size()));
    }
  }
  if (!whole.numbers.empty()) frames->numbers = whole.numbers;
  const std::vector<std::size_t> rows =
      vision::rows_of_frames(*frames, truth.size(), truth_file,
                             fmt::format("poses (the estimate {} holds {})", estimate_file.string(), estimate.size()));
  PosePairs pairs;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    if (!is_chosen(frames->frames[i].number)) continue;
    pairs.estimate.push_back(estimate[i]);
    pairs.truth.push_back(truth.at(rows[i]));
  }
  if (pairs.estimate.size() >= 2) return pairs;
  throw InvalidArgument(fmt::format("{} and {}: {} of the same frames{}: a motion needs two", estimate_file.string(),
                                    truth_file.string(), counted(pairs.estimate.size(), "pose"),
                                    compared.frames.empty() ? "" : " in --frames " + compared.frames));
}

int evaluate(EvalPosesArguments& arguments) {
  arguments.compared.resolve();
  for (const std::string& file : arguments.plots) require_plot_name("--plot", file);
  const auto [estimate, truth] = read_pairs(arguments.compared);
  const vision::PoseEvaluation evaluation = vision::evaluate_poses(estimate, truth);
  for (const std::string& file : arguments.plots) {
    write_plot(
        file, [&] { return vision::path_svg(estimate, truth); }, [&] { return vision::draw_path(estimate, truth); });
  }
  if (arguments.json) {
    fmt::print("{}\n", json_of(evaluation).dump(2));
  } else {
    print(evaluation);
  }
  return kOk;
}

}  // namespace

Command add_eval_poses(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("eval-poses", "Compare poses with the true ones, as KITTI's odometry kit does");
  auto arguments = std::make_shared<EvalPosesArguments>();
  arguments->compared.add_to(*command, "KITTI poses, or a folder of `run`",
                             "the true ones, of the same frames or of the whole sequence, or the sequence's folder");
  command
      ->add_option("--plot", arguments->plots,
                   "draw both paths from above, in metres: a new .png or .svg file; may be repeated")
      ->allow_extra_args(false)
      ->type_name("FILE");
  command->add_flag("--json", arguments->json, "print JSON");
  return {command, [arguments] { return evaluate(*arguments); }};
}

}  // namespace egosgm::app
