// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/metrics_json.h"
#include "apps/truth_pairs.h"
#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/evaluation.h"
#include "egosgm/vision/image_io.h"

namespace egosgm::app {
namespace {

using vision::DisparityCounts;
using vision::DisparityMetrics;
using Json = nlohmann::ordered_json;

struct EvalArguments {
  std::string estimate, truth, mask;
  bool json = false;
};

struct Row {
  std::string name;
  vision::EvaluationPair pair;
  DisparityCounts counts;
};

/// The truth where the mask, if there is one, is not 0.
cv::Mat masked_truth(const std::filesystem::path& truth_file, const std::filesystem::path& mask) {
  cv::Mat truth = vision::read_disparity(truth_file);
  if (mask.empty()) return truth;
  const std::filesystem::path file = is_directory(mask) ? mask / truth_file.filename().replace_extension(".png") : mask;
  const cv::Mat kept = vision::read_grey_png(file);
  if (kept.size() != truth.size()) {
    throw InvalidArgument(fmt::format("{}: the mask is {}x{}, the truth {}x{}", file.string(), kept.cols, kept.rows,
                                      truth.cols, truth.rows));
  }
  truth.setTo(kInvalidDisparity, kept == 0);
  return truth;
}

Row compare(const vision::EvaluationPair& pair, const std::filesystem::path& mask) {
  try {
    return {pair.estimate.stem().string(), pair,
            vision::compare_disparity(vision::read_disparity(pair.estimate), masked_truth(pair.truth, mask))};
  } catch (const InvalidArgument& error) {
    const std::string what = error.what();  // a reader names its file, the comparison cannot
    for (const std::string& file : {pair.estimate.string(), pair.truth.string(), mask.string()}) {
      if (!file.empty() && what.find(file) != std::string::npos) throw;
    }
    throw InvalidArgument(pair.estimate.string() + " and " + pair.truth.string() + ": " + what);
  }
}

Json json_of(const std::vector<Row>& rows, const DisparityMetrics& pooled, const DisparityMetrics& mean,
             const std::vector<std::filesystem::path>& without_estimate) {
  Json json{{"pairs", Json::array()},
            {"pooled", app::json_of(pooled)},
            {"mean", app::json_of(mean)},
            {"without_estimate", Json::array()}};
  for (const Row& row : rows) {
    Json entry{{"name", row.name},
               {"estimate", row.pair.estimate.string()},
               {"truth", row.pair.truth.string()},
               {"truth_pixels", row.counts.truth}};
    entry.update(app::json_of(vision::metrics_of(row.counts)));
    json["pairs"].push_back(std::move(entry));
  }
  for (const auto& file : without_estimate) json["without_estimate"].push_back(file.string());
  return json;
}

std::string cell(double value, int width, const char* unit) {
  return std::isnan(value) ? fmt::format("{:>{}}", "-", width) : fmt::format("{:>{}.3f}{}", value, width - 2, unit);
}

void print_row(const std::string& name, const DisparityMetrics& m) {
  fmt::print("{:<14}{}{}{}{}{}{}{}\n", name, cell(m.bad_or_missing, 16, " %"), cell(m.bad_of_valid, 14, " %"),
             cell(m.density, 11, " %"), cell(m.interpolated, 14, " %"), cell(m.d1, 11, " %"),
             cell(m.d1_interpolated, 17, " %"), cell(m.mae_px, 11, "px"));
}

int evaluate(const EvalArguments& arguments) {
  const vision::EvaluationPairs found = find_truth_pairs(arguments.estimate, arguments.truth);
  std::vector<Row> rows;
  std::vector<DisparityMetrics> each;
  DisparityCounts pooled;
  for (const vision::EvaluationPair& pair : found.pairs) {
    rows.push_back(compare(pair, arguments.mask));
    each.push_back(vision::metrics_of(rows.back().counts));
    pooled += rows.back().counts;
  }
  if (arguments.json) {
    fmt::print("{}\n",
               json_of(rows, vision::metrics_of(pooled), vision::mean_of(each), found.without_estimate).dump(2));
    return kOk;
  }
  fmt::print("{:<14}{:>16}{:>14}{:>11}{:>14}{:>11}{:>17}{:>11}\n", "", "bad_or_missing", "bad_of_valid", "density",
             "interpolated", "d1", "d1_interpolated", "mae");
  for (std::size_t i = 0; i < rows.size(); ++i) print_row(rows[i].name, each[i]);
  if (rows.size() > 1) {
    print_row("pooled", vision::metrics_of(pooled));
    print_row("mean", vision::mean_of(each));
  }
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
  return kOk;
}

}  // namespace

Command add_eval(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("eval", "Compare disparity maps with their truth, as KITTI's development kits do");
  auto arguments = std::make_shared<EvalArguments>();
  command
      ->add_option("--estimate", arguments->estimate,
                   "disparity map (KITTI PNG or PFM), a folder of them, or a folder of `run`")
      ->type_name("FILE|DIR")
      ->required();
  command->add_option("--truth", arguments->truth, "true disparity, or a folder of files with equal names")
      ->type_name("FILE|DIR")
      ->required();
  command
      ->add_option("--mask", arguments->mask,
                   "compare only where this grey PNG, or the one of the truth's name in this folder, is not 0")
      ->type_name("FILE|DIR");
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "In percent of the pixels with truth (bad_of_valid: of those with an estimate too); bad: off by more than 3 px.\n"
      "  bad_or_missing   bad, or without an estimate\n"
      "  interpolated     bad after filling holes from the background (KITTI 2012's official figure)\n"
      "  d1               off by more than 3 px and 5 %, or without an estimate (KITTI 2015); d1_interpolated "
      "likewise\n"
      "  mae              mean absolute error of the pixels with an estimate [px]\n"
      "pooled: over all pixels (KITTI 2015); mean: of the images' figures (KITTI 2012).");
  return {command, [arguments] { return evaluate(*arguments); }};
}

}  // namespace egosgm::app
