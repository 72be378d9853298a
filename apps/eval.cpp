// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/option_group.h"
#include "apps/progress.h"
#include "apps/truth_pairs.h"
#include "egosgm/error.h"
#include "egosgm/vision/evaluation.h"
#include "egosgm/vision/image_io.h"
#include "host/json_text.h"
#include "vision/disparity_figures.h"
#include "vision/estimate_reader.h"
#include "vision/file_io.h"
#include "vision/image_values.h"

namespace egosgm::app {
namespace {

using vision::DisparityCounts;
using vision::DisparityMetrics;
using Json = nlohmann::ordered_json;

constexpr double kMostPixels = 1e12;     // of a pair of a report, and their errors
constexpr std::size_t kLongFolder = 20;  // frames; a progress bar from here on

struct EvalArguments {
  ComparisonArguments compared;
  std::string mask;
  double scale = 256, truth_scale = 256;
  std::vector<std::string> reports;  // of --merge
  bool json = false;
};

/// An estimate that has truth.
struct Row {
  vision::EvaluationPair files;
  DisparityCounts counts;
};

struct Result {
  std::vector<Row> rows;
  std::vector<DisparityMetrics> each;  // of the rows
  DisparityCounts all;
  std::vector<std::string> warnings;  // what speaks against the estimates that were read

  void add(const DisparityCounts& counts) {
    each.push_back(vision::metrics_of(counts));
    all += counts;
  }
  DisparityMetrics pooled() const { return vision::metrics_of(all); }
  DisparityMetrics mean() const { return vision::mean_of(each); }
};

/// Throws InvalidArgument, naming both files, where `map` has another size than the estimate.
void expect_size(const vision::Image& estimate, const std::filesystem::path& file, const vision::Image& map,
                 const std::filesystem::path& its_file) {
  if (map.size() == estimate.size()) return;
  throw InvalidArgument(fmt::format("{} is {}x{}, {} is {}x{}: give maps of one size", file.string(), estimate.cols,
                                    estimate.rows, its_file.string(), map.cols, map.rows));
}

DisparityCounts compare(const vision::EvaluationPair& pair, const EvalArguments& arguments,
                        vision::EstimateReader& estimates) {
  const vision::Image estimate = estimates.read(pair.estimate, arguments.scale);
  vision::Image truth = vision::read_scaled(pair.truth, arguments.truth_scale);
  expect_size(estimate, pair.estimate, truth, pair.truth);
  estimates.compare(estimate, truth);
  if (!arguments.mask.empty()) {
    std::filesystem::path file = arguments.mask;
    if (is_directory(file)) file /= pair.truth.filename().replace_extension(".png");
    const vision::Image kept = vision::read_grey_image(file);
    expect_size(estimate, pair.estimate, kept, file);
    vision::set_where(truth, kInvalidDisparity, kept, [](auto value) { return value == 0; });
  }
  return vision::compare_disparity(estimate, truth);
}

Result measure(const vision::EvaluationPairs& found, const EvalArguments& arguments) {
  Result result;
  vision::EstimateReader estimates;
  for (const vision::EvaluationPair& pair : found.pairs) {
    vision::expect_scaled("--scale", arguments.scale, pair.estimate);
    vision::expect_scaled("--truth-scale", arguments.truth_scale, pair.truth);
  }
  const bool show = !arguments.json && isatty(STDOUT_FILENO) == 1 && found.pairs.size() >= kLongFolder;
  Progress progress(static_cast<int>(found.pairs.size()), !show);
  for (const vision::EvaluationPair& pair : found.pairs) {
    result.rows.push_back({pair, compare(pair, arguments, estimates)});
    result.add(result.rows.back().counts);
    progress.done(pair.name);
  }
  result.warnings = estimates.warnings(arguments.scale, arguments.truth_scale);
  return result;
}

Json json_of(const DisparityCounts& counts) {
  Json json;
  vision::for_each_count([&](const char* name, auto count, auto) { json[name] = counts.*count; });
  return json;
}

/// In percent, `mae` and `mean_error` in pixels; null where there is nothing to divide by.
Json json_of(const DisparityMetrics& metrics) {
  Json json;
  vision::for_each_metric([&](std::string name, auto metric, auto) {
    if (name.ends_with("_px")) name.resize(name.size() - 3);
    json[name] = metrics.*metric;
  });
  return json;
}

Json json_of(const vision::EvaluationPairs& found, const Result& result) {
  Json json{{"pairs", Json::array()},
            {"pooled", json_of(result.pooled())},
            {"mean", json_of(result.mean())},
            {"without_estimate", Json::array()}};
  for (std::size_t i = 0; i < result.rows.size(); ++i) {
    const Row& row = result.rows[i];
    Json entry{{"name", row.files.name},
               {"estimate", row.files.estimate.string()},
               {"truth", row.files.truth.string()},
               {"truth_pixels", row.counts.truth},
               {"counts", json_of(row.counts)}};
    entry.update(json_of(result.each[i]));
    json["pairs"].push_back(std::move(entry));
  }
  for (const auto& file : found.without_estimate) json["without_estimate"].push_back(file.string());
  if (!result.warnings.empty()) json["warnings"] = result.warnings;
  return json;
}

std::string cell(double value, int width, const char* unit) {
  return std::isnan(value) ? fmt::format("{:>{}}", "-", width) : fmt::format("{:>{}.3f}{}", value, width - 2, unit);
}

void print_row(const std::string& name, const DisparityMetrics& m) {
  fmt::print("{:<14}{}{}{}{}{}{}{}{}{}{}{}\n", name, cell(m.wrong_of_all, 13, " %"), cell(m.bad_of_valid, 14, " %"),
             cell(m.filled, 11, " %"), cell(m.density, 11, " %"), cell(m.bad_or_missing, 16, " %"),
             cell(m.interpolated, 14, " %"), cell(m.d1, 11, " %"), cell(m.d1_interpolated, 17, " %"),
             cell(m.bad_1px, 11, " %"), cell(m.mae_px, 11, "px"), cell(m.mean_error_px, 14, "px"));
}

void print_errors(const Result& result) {
  fmt::print("{:<14}{:>13}{:>14}{:>11}{:>11}{:>16}{:>14}{:>11}{:>17}{:>11}{:>11}{:>14}\n", "", "wrong_of_all",
             "bad_of_valid", "filled", "density", "bad_or_missing", "interpolated", "d1", "d1_interpolated", "bad_1px",
             "mae", "mean_error");
  for (std::size_t i = 0; i < result.rows.size(); ++i) print_row(result.rows[i].files.name, result.each[i]);
  if (result.each.size() > 1 || result.rows.empty()) {
    print_row("pooled", result.pooled());
    print_row("mean", result.mean());
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

/// Whether it is a number of pixels, or a sum of their errors.
template <typename Count>
bool read_count(const Json& json, Count& count) {
  const auto value = json.get<double>();
  if (!json.is_number() || std::abs(value) > kMostPixels) return false;
  count = static_cast<Count>(value);
  return value == static_cast<double>(count);
}

/// Whether no part is less than nothing or larger than its whole.
bool are_possible(const DisparityCounts& c) {
  return 0 <= c.sky_valid && 0 <= c.d1 && 0 <= c.d1_interpolated &&
         std::abs(c.signed_error_px) <= c.absolute_error_px && c.sky <= c.truth && c.sky_valid <= c.sky &&
         c.sky_valid <= c.valid && c.valid - c.sky_valid <= c.truth - c.sky && c.bad_1px <= c.valid &&
         c.bad <= c.bad_1px && c.d1 <= c.bad && c.bad_interpolated <= c.truth &&
         c.d1_interpolated <= c.bad_interpolated;
}

/// The counts of each pair of a report. Throws InvalidArgument.
std::vector<DisparityCounts> counts_of(const Json& report, const std::string& file) {
  std::vector<DisparityCounts> all;
  bool is_sound = true;
  try {
    for (const Json& pair : report.at("pairs")) {
      all.emplace_back();
      vision::for_each_count([&](const char* name, auto count, auto) {
        is_sound = read_count(pair.at("counts").at(name), all.back().*count) && is_sound;
      });
      is_sound = is_sound && are_possible(all.back());
    }
  } catch (const Json::exception&) {
    is_sound = false;
  }
  if (is_sound && !all.empty()) return all;
  throw InvalidArgument(file + ": is no report of `egosgm eval --json`: give --merge such reports");
}

/// The figures of all pairs of the reports, over all their pixels. Throws InvalidArgument and IoError.
int merge(const EvalArguments& arguments) {
  Result result;
  std::map<std::string, std::string> read;  // pairs, and the first file that holds them
  for (const std::string& file : arguments.reports) {
    const Json report = parse_json(vision::read_file(file, kMaxJsonBytes), file);
    const std::vector<DisparityCounts> all = counts_of(report, file);
    auto pair = report.at("pairs").begin();
    for (const DisparityCounts& counts : all) {
      if (const auto [first, is_new] = read.emplace((pair++)->dump(), file); !is_new && counts.valid > 0) {
        throw InvalidArgument("--merge " + file + ": holds pairs of " + first->second +
                              ", whose pixels would count twice: give each pair once");
      }
      result.add(counts);
    }
    for (const Json& warning : report.value("warnings", Json::array())) {
      if (warning.is_string()) result.warnings.push_back(file + ": " + warning.get<std::string>());
    }
  }
  if (arguments.json) {
    Json json{{"reports", arguments.reports.size()},
              {"pairs", result.each.size()},
              {"pooled", json_of(result.pooled())},
              {"mean", json_of(result.mean())}};
    if (!result.warnings.empty()) json["warnings"] = result.warnings;
    fmt::print("{}\n", dumped(json, 2));
    return kOk;
  }
  print_errors(result);
  for (const std::string& warning : result.warnings) fmt::print("{}\n", warning);
  return kOk;
}

int evaluate(EvalArguments arguments) {
  if (!arguments.reports.empty()) return merge(arguments);
  arguments.compared.resolve();
  const vision::EvaluationPairs found =
      find_truth_pairs(arguments.compared.estimate, arguments.compared.truth, arguments.compared.frames);
  const Result result = measure(found, arguments);
  if (arguments.json) {
    fmt::print("{}\n", dumped(json_of(found, result), 2));
    return kOk;
  }
  print_errors(result);
  print_pairing(found);
  for (const std::string& warning : result.warnings) fmt::print("{}\n", warning);
  return kOk;
}

}  // namespace

Command add_eval(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("eval", "Compare disparity maps with their truth, as KITTI's development kits do");
  auto arguments = std::make_shared<EvalArguments>();
  OptionGroup options(*command);
  arguments->compared.add_to(
      *command, "disparity map (KITTI PNG, 16-bit PNG with --scale, PFM, .npy), a folder of them, or a folder of `run`",
      "true disparity, or a folder of files with equal names");
  options.add("--mask", arguments->mask, "FILE|DIR",
              "compare only where this grey PNG, or the one of the truth's name in this folder, is not 0");
  options.add("--scale", arguments->scale, "STEPS", "steps a pixel of 16-bit PNG in --estimate; KITTI's have 256")
      ->capture_default_str();
  options.add("--truth-scale", arguments->truth_scale, "STEPS", "the same of the truth")->capture_default_str();
  options
      .add("--merge", arguments->reports, "REPORT...",
           "pool what `egosgm eval --json` printed for several sequences, over all their pixels")
      ->excludes("--estimate", "--truth", "ESTIMATE", "--frames", "--mask", "--scale", "--truth-scale");
  options.add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "In percent of the pixels with truth (bad_of_valid: of those with an estimate too); bad: off by more than 3 px.\n"
      "  wrong_of_all     bad; what is missing does not count\n"
      "  filled           with an estimate; density: of the pixels with a surface, those with an estimate\n"
      "  bad_or_missing   bad, or without an estimate; who guesses everywhere looks good in it\n"
      "  interpolated     bad after filling holes from the background (KITTI 2012's official figure)\n"
      "  d1               off by more than 3 px and 5 %, or without an estimate (KITTI 2015); d1_interpolated "
      "likewise\n"
      "  bad_1px          off by more than 1 px, or without an estimate\n"
      "  mae              mean absolute error of the pixels with an estimate [px]\n"
      "  mean_error       their mean signed error [px]: below 0, they look too far; --mask with what moves shows a "
      "lag\n"
      "pooled: over all pixels (KITTI 2015); mean: of the images' figures (KITTI 2012).\n"
      "A truth of 1/256 px (1 in KITTI's PNG) or less says that nothing is there, the sky for instance: a hole is "
      "right.\n"
      "Over time and beside another method: `egosgm eval-video`, of the Python package. docs/use/evaluation.md has the "
      "formula, the source and the pixels of every figure.");
  return {command, [arguments] { return evaluate(*arguments); }};
}

}  // namespace egosgm::app
