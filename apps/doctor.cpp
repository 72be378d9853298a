// SPDX-License-Identifier: Apache-2.0
// Looks for what is wrong with a sequence before it is matched. Needs no device.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/core.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/frame_times.h"
#include "apps/sequence_arguments.h"
#include "egosgm/error.h"
#include "egosgm/odometry.h"
#include "egosgm/options.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/opencv.h"
#include "host/vision/examination.h"

namespace egosgm::app {
namespace {

constexpr double kMaxGap = 1.6;  // of the usual time between two frames

using vision::Finding;
using vision::Verdict;

struct DoctorArguments {
  SequenceArguments input;
  PipelineOptions options;
  int samples = 5;
  bool json = false;
};

double quantile(std::vector<double> values, double at) {
  const auto place = std::lround(at * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

class Doctor {
 public:
  Doctor(const vision::StereoSequence& sequence, const PipelineOptions& options)
      : sequence_(sequence),
        examination_(sequence.has_calibration ? std::optional(sequence.calibration) : std::nullopt,
                     options.min_disparity, options.min_disparity + options.disparities) {
    vision::check_image_sizes(sequence);
  }

  std::vector<Finding> examine(int wanted) {
    if (!sequence_.note.empty()) {
      add(Verdict::kNote, "frames", sequence_.note, "a longer motion is harder: give all frames where there are some");
    }
    const std::vector<std::size_t> samples = places(wanted);
    for (const std::size_t at : samples) {
      const vision::StereoImages images = vision::read_images(sequence_.frames[at]);
      examination_.add(images.left, images.right);
    }
    for (Finding& finding : examination_.findings(sequence_.frames.size())) findings_.push_back(std::move(finding));
    const bool is_sound = std::none_of(findings_.begin(), findings_.end(),
                                       [](const Finding& f) { return f.verdict == Verdict::kProblem; });
    check_times();
    if (is_sound && sequence_.has_calibration) check_motion(samples);
    return std::move(findings_);
  }

 private:
  void add(Verdict verdict, const char* check, std::string text, std::string remedy = {}) {
    findings_.push_back({verdict, check, std::move(text), std::move(remedy)});
  }
  void fine(const char* check, std::string text) { add(Verdict::kFine, check, std::move(text)); }
  void problem(const char* check, std::string text, std::string remedy) {
    add(Verdict::kProblem, check, std::move(text), std::move(remedy));
  }

  /// Of the frames that are looked at, spread over the sequence.
  std::vector<std::size_t> places(int wanted) const {
    const std::size_t count = sequence_.frames.size(), samples = std::min(count, static_cast<std::size_t>(wanted));
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < samples; ++i) places.push_back(samples == 1 ? 0 : i * (count - 1) / (samples - 1));
    return places;
  }

  /// A run that finds no motion sends its user here.
  void check_motion(const std::vector<std::size_t>& samples) {
    std::size_t tried = 0, without = 0;
    std::string reason;
    for (const std::size_t at : samples) {
      if (at + 1 >= sequence_.frames.size()) continue;
      StereoOdometry odometry(sequence_.calibration);
      OdometryResult result;
      for (const std::size_t frame : {at, at + 1}) {
        const vision::StereoImages images = vision::read_images(sequence_.frames[frame]);
        result = odometry.process(vision::image_view(images.left), vision::image_view(images.right));
      }
      ++tried;
      if (result.motion) continue;
      ++without;
      reason = result.reason;
    }
    if (2 * without <= tried) return;
    add(Verdict::kNote, "motion",
        fmt::format("no motion in {} of {} steps that were looked at ({})", without, tried, reason),
        "without a motion nothing is predicted: give frames that follow each other closely, all of one drive, left and "
        "right of the same moments; or the poses (run --poses)");
  }

  void check_times() {
    FrameTimes times;
    try {
      times = frame_times(sequence_);
    } catch (const InvalidArgument& error) {
      return problem("times", error.what(), "give a row for each frame, or remove the file");
    }
    if (times.seconds.empty()) {
      return add(Verdict::kNote, "times", "no time stamps (times.txt or timestamps.txt) beside the images",
                 "without them, gaps are not seen");
    }
    std::vector<double> steps;
    for (std::size_t i = 1; i < times.seconds.size(); ++i) steps.push_back(times.seconds[i] - times.seconds[i - 1]);
    if (steps.empty()) return fine("times", "a single frame");
    const double usual = quantile(steps, 0.5);
    std::size_t gaps = 0, first = 0;
    for (std::size_t i = steps.size(); i-- > 0;) {
      if (steps[i] > 0 && steps[i] <= kMaxGap * usual) continue;
      ++gaps;
      first = i;
    }
    const std::string text = fmt::format("{:.4g} s between two frames ({})", usual, times.file.string());
    constexpr double kUsual_s[] = {1e-4, 20};
    for (const auto& [unit, seconds] :
         {std::pair{"milliseconds", 1e-3}, {"microseconds", 1e-6}, {"nanoseconds", 1e-9}}) {
      if (usual <= kUsual_s[1] || usual * seconds < kUsual_s[0] || usual * seconds > kUsual_s[1]) continue;
      return problem("times", text,
                     fmt::format("a time is in seconds: are these {} ({:.4g} s)? Divide them", unit, usual * seconds));
    }
    if (gaps == 0) return fine("times", text);
    const std::string& before = sequence_.frames[first].name;
    const vision::StereoFrame &last = sequence_.frames[first], &next = sequence_.frames[first + 1];
    if (steps[first] <= 0) {
      return problem("times",
                     text + fmt::format(", but after frame {} the time goes back by {:.4g} s", before, -steps[first]),
                     "sort the frames by time, and drop those that came twice");
    }
    problem("times",
            text + fmt::format(", but {}, the first of {:.4g} s after frame {}", counted(gaps, "gap"), steps[first],
                               before),
            fmt::format("record without dropping frames, or run the parts alone: --frames :{} and --frames {}:",
                        last.number, next.number));
  }

  const vision::StereoSequence& sequence_;
  vision::Examination examination_;
  std::vector<Finding> findings_;
};

const char* word(Verdict verdict) {
  return verdict == Verdict::kFine ? "ok" : verdict == Verdict::kNote ? "note" : "problem";
}

void print(const std::vector<Finding>& findings, bool as_json) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    json.push_back({{"verdict", word(f.verdict)}, {"check", f.check}, {"text", f.text}, {"remedy", f.remedy}});
    if (as_json) continue;
    fmt::print("{:<8} {:<12} {}\n", word(f.verdict), f.check, f.text);
    if (!f.remedy.empty()) fmt::print("{:>21} {}\n", "->", f.remedy);
  }
  if (as_json) fmt::print("{}\n", json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
}

std::vector<Finding> findings_of(const DoctorArguments& arguments) {
  vision::StereoSequence sequence;
  try {
    sequence = arguments.input.open(/*needs_calibration=*/false);
  } catch (const vision::NegativeBaseline& error) {
    return {
        {Verdict::kProblem, "calibration", error.what(),
         "the calibration's right camera stands left of its left one: exchange the two cameras' rows, and where the "
         "images are swapped, too, exchange them as well; or its transformation is the inverse of the one that is "
         "meant"}};
  }
  return Doctor(sequence, arguments.options).examine(arguments.samples);
}

int examine(const DoctorArguments& arguments) {
  arguments.options.validate();
  if (arguments.samples < 1) {
    throw InvalidArgument(fmt::format("--samples {}: choose a number above 0", arguments.samples));
  }
  const std::vector<Finding> findings = findings_of(arguments);
  print(findings, arguments.json);
  const auto problems =
      std::count_if(findings.begin(), findings.end(), [](const Finding& f) { return f.verdict == Verdict::kProblem; });
  if (!arguments.json) {
    fmt::print("{} found.\n", problems == 0 ? "No problem was" : counted(problems, "problem"));
  }
  return problems == 0 ? kOk : kBadInput;
}

}  // namespace

Command add_doctor(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("doctor", "Check a sequence: rows, swapped sides, calibration, range, time stamps");
  auto arguments = std::make_shared<DoctorArguments>();
  arguments->input.add_to(*command);
  PipelineOptions& options = arguments->options;
  command->add_option("--disparities", options.disparities, "size of the range that is to be searched [px]")
      ->type_name("D")
      ->capture_default_str();
  command->add_option("--min-disparity", options.min_disparity, "where it begins [px], of either sign")
      ->type_name("N")
      ->capture_default_str();
  command->add_option("--samples", arguments->samples, "frames to look at, spread over the sequence")
      ->type_name("N")
      ->capture_default_str();
  command->add_flag("--json", arguments->json, "print JSON");
  command->footer(
      "Points are matched in the whole image, without regard to rows, sides or range. Exit code 2 where a problem was\n"
      "found; below each stands its remedy.");
  return {command, [arguments] { return examine(*arguments); }};
}

}  // namespace egosgm::app
