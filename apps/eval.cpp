// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <unistd.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/metrics_json.h"
#include "apps/plot_file.h"
#include "apps/progress.h"
#include "apps/truth_pairs.h"
#include "apps/video_input.h"
#include "egosgm/error.h"
#include "egosgm/vision/evaluation.h"
#include "egosgm/vision/video_evaluation.h"
#include "host/json_text.h"
#include "host/vision/file_io.h"
#include "host/vision/pair_with_truth.h"
#include "host/vision/video_plot.h"

namespace egosgm::app {
namespace {

using vision::DisparityCounts;
using vision::DisparityMetrics;
using vision::VideoCounts;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxReportBytes = std::size_t{1} << 30;
constexpr std::size_t kLongFolder = 20;  // frames; a progress bar from here on

struct EvalArguments {
  ComparisonArguments compared;
  VideoArguments video;
  vision::VideoEvaluationOptions options;
  std::vector<std::string> reports;  // of --merge
  std::string plot_frames, plot_density;
  bool json = false;
};

/// A frame that has truth.
struct Row {
  std::string name;
  FrameFiles files;
  DisparityCounts counts;
};

struct Result {
  std::vector<Row> rows;
  std::vector<DisparityMetrics> each;  // of the rows
  DisparityMetrics pooled, mean;
  vision::VideoEvaluation video;
};

const DisparityCounts& errors_of(const VideoCounts& counts) { return counts.region(vision::Region::kAll).errors; }

Result measure(const VideoInput& input, const EvalArguments& arguments) {
  Result result;
  {
    const bool show = !arguments.json && isatty(STDOUT_FILENO) == 1 && input.frames().size() >= kLongFolder;
    Progress progress(static_cast<int>(input.frames().size()), !show);
    result.video =
        vision::evaluate_video(input.video(), arguments.options, [&](int i) { progress.done(input.frames()[i].name); });
  }
  DisparityCounts pooled;
  for (std::size_t i = 0; i < input.frames().size(); ++i) {
    if (input.frames()[i].truth.empty()) continue;
    const DisparityCounts& counts = errors_of(result.video.frames[i]);
    result.rows.push_back({input.frames()[i].name, input.frames()[i], counts});
    result.each.push_back(vision::metrics_of(counts));
    pooled += counts;
  }
  result.pooled = vision::metrics_of(pooled);
  result.mean = vision::mean_of(result.each);
  return result;
}

Json json_of(const std::vector<vision::NamedFigure>& figures) {
  Json json = Json::object();
  for (const vision::NamedFigure& figure : figures) json[figure.name] = figure.value;
  return json;
}

Json json_of_regions(const VideoCounts& counts) {
  Json json = Json::object();
  for (std::size_t r = 0; r < counts.regions.size(); ++r) {
    const vision::RegionCounts& region = counts.regions[r];
    if (region.errors.truth == 0) continue;
    Json entry{{"truth_pixels", region.errors.truth}};
    entry.update(json_of(figures_of(region)));
    json[vision::kRegionNames[r]] = std::move(entry);
  }
  return json;
}

double mean(double sum, std::int64_t count) { return count > 0 ? sum / static_cast<double>(count) : std::nan(""); }

Json json_of(const vision::DensityCounts& counts) {
  Json at_density = Json::array(), kept = Json::array();
  for (const vision::DensityPoint& point : densities_of(counts)) {
    at_density.push_back({{"density_percent", point.density_percent},
                          {"reached_percent", point.reached_percent},
                          {"bad_percent", point.bad_percent}});
  }
  for (const vision::SparsificationPoint& point : sparsification_of(counts)) {
    kept.push_back({{"kept_percent", point.kept_percent},
                    {"bad_percent", point.bad_percent},
                    {"oracle_bad_percent", point.oracle_bad_percent},
                    {"mae", point.mae_px},
                    {"oracle_mae", point.oracle_mae_px}});
  }
  return {{"at_density", at_density}, {"sparsification", kept}};
}

Json json_of(const VideoInput& input, const vision::VideoEvaluation& video) {
  Json json{{"frames", input.frames().size()},         {"pairs", input.successors()},
            {"motion", input.motion_source()},         {"figures", json_of(figures_of(video.total))},
            {"regions", json_of_regions(video.total)}, {"over_frames", Json::array()}};
  for (std::size_t i = 0; i < video.frames.size(); ++i) {
    Json entry{{"name", input.frames()[i].name}};
    entry.update(json_of(figures_of(video.frames[i])));
    json["over_frames"].push_back(std::move(entry));
  }
  if (video.total.density.truth > 0) json["density"] = json_of(video.total.density);
  return json;
}

template <typename Counts, typename Action>
void for_each_count(Counts& counts, Action act) {
  act("truth", counts.truth);
  act("sky", counts.sky);
  act("sky_valid", counts.sky_valid);
  act("valid", counts.valid);
  act("bad", counts.bad);
  act("d1", counts.d1);
  act("bad_interpolated", counts.bad_interpolated);
  act("d1_interpolated", counts.d1_interpolated);
  act("absolute_error_px", counts.absolute_error_px);
}

Json json_of(const DisparityCounts& counts) {
  Json json;
  for_each_count(counts, [&](const char* name, auto count) { json[name] = count; });
  return json;
}

Json json_of(const VideoInput& input, const Result& result) {
  Json json{{"pairs", Json::array()},
            {"pooled", app::json_of(result.pooled)},
            {"mean", app::json_of(result.mean)},
            {"without_estimate", Json::array()}};
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    const Row& row = result.rows[i];
    Json entry{{"name", row.name},
               {"estimate", row.files.estimate.string()},
               {"truth", row.files.truth.string()},
               {"truth_pixels", row.counts.truth},
               {"counts", json_of(row.counts)}};
    entry.update(app::json_of(result.each[i]));
    json["pairs"].push_back(std::move(entry));
  }
  for (const auto& file : input.truth_pairs().without_estimate) json["without_estimate"].push_back(file.string());
  json["video"] = json_of(input, result.video);
  if (const auto doubts = input.doubts(); !doubts.empty()) json["doubts"] = doubts;
  return json;
}

std::string cell(double value, int width, const char* unit) {
  return std::isnan(value) ? fmt::format("{:>{}}", "-", width) : fmt::format("{:>{}.3f}{}", value, width - 2, unit);
}

void print_row(const std::string& name, const DisparityMetrics& m) {
  fmt::print("{:<14}{}{}{}{}{}{}{}{}{}\n", name, cell(m.wrong_of_all, 13, " %"), cell(m.bad_of_valid, 14, " %"),
             cell(m.filled, 11, " %"), cell(m.density, 11, " %"), cell(m.bad_or_missing, 16, " %"),
             cell(m.interpolated, 14, " %"), cell(m.d1, 11, " %"), cell(m.d1_interpolated, 17, " %"),
             cell(m.mae_px, 11, "px"));
}

void print_header() {
  fmt::print("{:<14}{:>13}{:>14}{:>11}{:>11}{:>16}{:>14}{:>11}{:>17}{:>11}\n", "", "wrong_of_all", "bad_of_valid",
             "filled", "density", "bad_or_missing", "interpolated", "d1", "d1_interpolated", "mae");
}

void print_errors(const Result& result) {
  if (result.rows.empty()) return;
  print_header();
  for (std::size_t i = 0; i < result.rows.size(); ++i) print_row(result.rows[i].name, result.each[i]);
  if (result.rows.size() > 1) {
    print_row("pooled", result.pooled);
    print_row("mean", result.mean);
  }
}

void print_over_time(const VideoInput& input, const VideoCounts& total) {
  bool first = true;
  for (const vision::NamedFigure& figure : figures_of(total)) {
    if (std::isnan(figure.value)) continue;
    if (first) {
      fmt::print("\nover time, {} of frames{}{}\n", counted(input.successors(), "pair"),
                 input.motion_source().empty() ? "" : ", ", input.motion_source());
    }
    first = false;
    fmt::print("  {:<46}{:>12.4f}\n", figure.name, figure.value);
  }
}

void print_regions(const VideoCounts& total) {
  fmt::print("\n{:<12}{:>12}{:>13}{:>14}{:>11}{:>11}{:>16}{:>14}{:>12}{:>12}\n", "region", "truth", "wrong_of_all",
             "bad_of_valid", "filled", "density", "bad_or_missing", "interpolated", "mae", "tepe");
  for (std::size_t r = 0; r < total.regions.size(); ++r) {
    const vision::RegionCounts& region = total.regions[r];
    if (region.errors.truth == 0) continue;
    const DisparityMetrics m = vision::metrics_of(region.errors);
    fmt::print("{:<12}{:>12}{}{}{}{}{}{}{}{}\n", vision::kRegionNames[r], region.errors.truth,
               cell(m.wrong_of_all, 13, " %"), cell(m.bad_of_valid, 14, " %"), cell(m.filled, 11, " %"),
               cell(m.density, 11, " %"), cell(m.bad_or_missing, 16, " %"), cell(m.interpolated, 14, " %"),
               cell(m.mae_px, 12, "px"), cell(mean(region.tepe.sum_px, region.tepe.pixels), 12, "px"));
  }
}

void print_density(const vision::DensityCounts& counts) {
  if (counts.truth == 0) return;
  fmt::print("\n{:<12}{:>12}{:>12}\n", "density", "reached", "bad");
  for (const vision::DensityPoint& point : densities_of(counts)) {
    fmt::print("{:<12}{}{}\n", fmt::format("{:.0f} %", point.density_percent), cell(point.reached_percent, 12, " %"),
               cell(point.bad_percent, 12, " %"));
  }
}

void print_pairing(const vision::EvaluationPairs& found) {
  for (const vision::EvaluationPair& pair : found.pairs) {
    if (!pair.same_name) {
      fmt::print("{} is compared with {}: only the number is the same\n", pair.estimate.filename().string(),
                 pair.truth.string());
    }
  }
  if (!found.without_estimate.empty()) {
    fmt::print("{} without an estimate, the first is {}\n", counted(found.without_estimate.size(), "truth file"),
               found.without_estimate.front().string());
  }
}

/// The sequence's own truth stands for one that is not given, where it has any.
void complete_truth(EvalArguments& arguments) {
  arguments.compared.resolve(arguments.video.sequence.empty());
  if (!arguments.compared.truth.empty()) return;
  const std::filesystem::path sequence = arguments.video.sequence;
  if (is_directory(sequence / "truth") || !arguments.video.scene.empty()) arguments.compared.truth = sequence;
}

void write_plots(const EvalArguments& arguments, const vision::VideoEvaluation& video) {
  if (!arguments.plot_frames.empty()) {
    write_plot(
        arguments.plot_frames, [&] { return vision::over_frames_svg(video.frames); },
        [&] { return vision::draw_over_frames(video.frames); });
  }
  if (!arguments.plot_density.empty()) {
    write_plot(
        arguments.plot_density, [&] { return vision::density_svg(video.total.density); },
        [&] { return vision::draw_density(video.total.density); });
  }
}

/// The figures of all pairs of the reports, over all their pixels. Throws InvalidArgument and IoError.
int merge(const EvalArguments& arguments) {
  Result result;
  DisparityCounts pooled;
  for (const std::string& file : arguments.reports) {
    const Json report = parse_json(vision::read_file(file, kMaxReportBytes), file);
    try {
      for (const Json& pair : report.at("pairs")) {
        DisparityCounts counts;
        for_each_count(counts, [&](const char* name, auto& count) { pair.at("counts").at(name).get_to(count); });
        result.each.push_back(vision::metrics_of(counts));
        pooled += counts;
      }
    } catch (const Json::exception&) {
      throw InvalidArgument(file + ": is no report of `egosgm eval --json`: give --merge such reports");
    }
  }
  result.pooled = vision::metrics_of(pooled);
  result.mean = vision::mean_of(result.each);
  if (arguments.json) {
    const Json json{{"reports", arguments.reports.size()},
                    {"pairs", result.each.size()},
                    {"pooled", app::json_of(result.pooled)},
                    {"mean", app::json_of(result.mean)}};
    fmt::print("{}\n", dumped(json, 2));
    return kOk;
  }
  print_header();
  print_row("pooled", result.pooled);
  print_row("mean", result.mean);
  return kOk;
}

int evaluate(EvalArguments arguments) {
  if (!arguments.reports.empty()) return merge(arguments);
  if (!arguments.plot_frames.empty()) require_plot_name("--plot-frames", arguments.plot_frames);
  if (!arguments.plot_density.empty()) require_plot_name("--plot-density", arguments.plot_density);
  complete_truth(arguments);
  const VideoInput input(arguments.compared, arguments.video);
  const Result result = measure(input, arguments);
  write_plots(arguments, result.video);
  if (arguments.json) {
    fmt::print("{}\n", dumped(json_of(input, result), 2));
    return kOk;
  }
  print_errors(result);
  const VideoCounts& total = result.video.total;
  if (input.successors() > 0 || !arguments.video.against.empty() || total.density.truth > 0 ||
      total.region(vision::Region::kAll).trust.valid > 0) {
    print_over_time(input, total);
    if (!result.rows.empty()) print_regions(total);
    print_density(total.density);
  }
  print_pairing(input.truth_pairs());
  for (const std::string& doubt : input.doubts()) fmt::print("{}\n", doubt);
  return kOk;
}

}  // namespace

Command add_eval(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "eval", "Compare disparity maps with their truth, as KITTI's development kits do, and with each other over time");
  auto arguments = std::make_shared<EvalArguments>();
  arguments->compared.add_to(
      *command, "disparity map (KITTI PNG, 16-bit PNG with --scale, PFM, .npy), a folder of them, or a folder of `run`",
      "true disparity, or a folder of files with equal names; not needed with --sequence");
  arguments->video.add_to(*command);
  command
      ->add_option("--near", arguments->options.near_px,
                   "the region `near` begins at this true disparity [px]; the rest is `far`")
      ->type_name("PX")
      ->capture_default_str();
  command->add_option("--plot-frames", arguments->plot_frames, "draw the figures over the frames: a .png or .svg file")
      ->type_name("FILE");
  command
      ->add_option("--plot-density", arguments->plot_density,
                   "draw the bad pixels against the share of pixels kept: a .png or .svg file; with --variance or "
                   "--confidence")
      ->type_name("FILE");
  command
      ->add_option("--merge", arguments->reports,
                   "pool what `egosgm eval --json` printed for several sequences, over all their pixels")
      ->type_name("REPORT...")
      ->excludes("--estimate", "--truth", "ESTIMATE");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "In percent of the pixels with truth (bad_of_valid: of those with an estimate too); bad: off by more than 3 px.\n"
      "  wrong_of_all     bad; what is missing does not count\n"
      "  filled           with an estimate; density: of the pixels with a surface, those with an estimate\n"
      "  bad_or_missing   bad, or without an estimate; who guesses everywhere looks good in it\n"
      "  interpolated     bad after filling holes from the background (KITTI 2012's official figure)\n"
      "  d1               off by more than 3 px and 5 %, or without an estimate (KITTI 2015); d1_interpolated "
      "likewise\n"
      "  mae              mean absolute error of the pixels with an estimate [px]\n"
      "pooled: over all pixels (KITTI 2015); mean: of the images' figures (KITTI 2012).\n"
      "A truth of 1/256 px (1 in KITTI's PNG) or less says that nothing is there, the sky for instance: a hole is "
      "right.\n"
      "Beside --against, among pixels that `run --write reason` trusts, and over time: docs/evaluation.md has the "
      "formula, the source and the pixels of every figure.");
  return {command, [arguments] { return evaluate(*arguments); }};
}

}  // namespace egosgm::app
