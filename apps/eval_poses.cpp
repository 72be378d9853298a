// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/counted.h"
#include "egosgm/error.h"
#include "egosgm/vision/file_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/pose_evaluation.h"
#include "egosgm/vision/pose_plot.h"
#include "egosgm/vision/poses_io.h"

namespace egosgm::app {
namespace {

using Json = nlohmann::ordered_json;
constexpr double kDegrees = 180.0 / 3.14159265358979323846;

struct EvalPosesArguments {
  std::string estimate, truth;
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
  fmt::print("at the end       {:.3f} m = {:.3f} %  {:.3f} deg\n", e.end_drift_m, e.end_drift_percent,
             e.rotation_end_drift_deg);
  if (e.segments.empty()) return;
  fmt::print("segments         {:.3f} %  {:.5f} deg/m{}\n", e.segment_translation_percent, e.segment_rotation_deg_per_m,
             e.short_segments ? " (of 5 to 50 m: not comparable with KITTI's of 100 to 800 m)" : "");
  for (const vision::SegmentError& segment : e.segments) {
    fmt::print("{:8.0f} m {:6d}  {:.3f} %  {:.5f} deg/m\n", segment.length_m, segment.segments,
               segment.translation_percent, segment.rotation_deg_per_m);
  }
}

bool is_svg(const std::string& file) {
  const std::string extension = std::filesystem::path(file).extension();
  if (extension != ".svg" && extension != ".png") {
    throw InvalidArgument("--plot " + file + ": the name must end in .png or .svg");
  }
  return extension == ".svg";
}

int evaluate(const EvalPosesArguments& arguments) {
  for (const std::string& file : arguments.plots) is_svg(file);
  const auto estimate = vision::read_poses(arguments.estimate), truth = vision::read_poses(arguments.truth);
  const vision::PoseEvaluation evaluation = vision::evaluate_poses(estimate, truth);
  for (const std::string& file : arguments.plots) {
    if (is_svg(file)) {
      vision::write_file(file, vision::path_svg(estimate, truth));
    } else {
      vision::write_png(file, vision::draw_path(estimate, truth));
    }
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
  command->add_option("--estimate", arguments->estimate, "KITTI poses, for example OUT/poses.txt")
      ->type_name("FILE")
      ->required();
  command->add_option("--truth", arguments->truth, "the true ones, of the same frames")->type_name("FILE")->required();
  command
      ->add_option("--plot", arguments->plots,
                   "draw both paths from above, in metres: a .png or .svg file; may be repeated")
      ->allow_extra_args(false)
      ->type_name("FILE");
  command->add_flag("--json", arguments->json, "print JSON");
  return {command, [arguments] { return evaluate(*arguments); }};
}

}  // namespace egosgm::app
