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
#include "apps/doubt.h"
#include "apps/frame_times.h"
#include "apps/sequence_arguments.h"
#include "egosgm/error.h"
#include "egosgm/options.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/rectification.h"

namespace egosgm::app {
namespace {

constexpr std::size_t kFewestMatches = 30;
constexpr double kMaxOffset_px = 0.6;    // KITTI's own pairs reach that
constexpr double kMaxSpread_px = 1.0;    // of the rest, 90 % of the matches
constexpr double kClippedShare = 0.01;   // of the matches
constexpr double kBehindShare = 0.02;    // with a disparity that no point before the cameras has
constexpr double kBehind_px = 1.0;       // by more than this
constexpr double kMaxGap = 1.6;          // of the usual time between two frames
constexpr double kMaxBrightness = 1.25;  // of one image by the other's

struct DoctorArguments {
  SequenceArguments input;
  PipelineOptions options;
  int samples = 5;
  bool json = false;
};

enum class Verdict { kFine, kNote, kProblem };

struct Finding {
  Verdict verdict;
  std::string check, text, remedy;
};

double quantile(std::vector<double> values, double at) {
  const auto place = std::lround(at * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

double share(const std::vector<double>& values, const std::function<bool(double)>& which) {
  return static_cast<double>(std::count_if(values.begin(), values.end(), which)) / static_cast<double>(values.size());
}

/// What the sampled frames showed.
struct Samples {
  std::vector<vision::PairMatch> matches;
  std::vector<double> disparity, row_error;  // of the matches: x_left - x_right, y_right - y_left
  double left_brightness = 0, right_brightness = 0;
  int frames = 0, narrow = 0, depth_bits = 8;  // narrow: 8 bits in 16
};

class Doctor {
 public:
  Doctor(const vision::StereoSequence& sequence, const PipelineOptions& options)
      : sequence_(sequence), options_(options), size_(vision::check_image_sizes(sequence)) {}

  std::vector<Finding> examine(int samples) {
    if (!sequence_.note.empty()) {
      add(Verdict::kNote, "frames", sequence_.note, "a longer motion is harder: give all frames where there are some");
    }
    look_at_frames(samples);
    check_images();
    check_calibration();
    if (samples_.matches.size() < kFewestMatches) {
      problem("matches", fmt::format("only {} found in both images", counted(samples_.matches.size(), "point")),
              "give the left and right images of the same moments, sharp, and overlapping");
    } else {
      check_rows();
      check_sides();
      check_range();
    }
    check_times();
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

  void look_at_frames(int wanted) {
    const std::size_t count = sequence_.frames.size();
    const std::size_t samples = std::min(count, static_cast<std::size_t>(wanted));
    for (std::size_t i = 0; i < samples; ++i) {
      const std::size_t at = samples == 1 ? 0 : i * (count - 1) / (samples - 1);
      const vision::StereoImages images = vision::read_images(sequence_.frames[at]);
      samples_.depth_bits = images.left.depth() == CV_8U ? 8 : 16;
      samples_.left_brightness += cv::mean(images.left)[0];
      samples_.right_brightness += cv::mean(images.right)[0];
      ++samples_.frames;
      samples_.narrow += vision::holds_8_bits_in_16(images.left) && vision::holds_8_bits_in_16(images.right);
      for (const vision::PairMatch& match : vision::match_pair(images.left, images.right)) {
        samples_.matches.push_back(match);
        samples_.disparity.push_back(match.left.x - match.right.x);
        samples_.row_error.push_back(match.right.y - match.left.y);
      }
    }
  }

  void check_images() {
    const std::string text = fmt::format("{} of {}x{}, {} bit", counted(sequence_.frames.size(), "pair"), size_.width,
                                         size_.height, samples_.depth_bits);
    if (samples_.narrow == samples_.frames) {
      return problem("images", text + ", but no value above 255: the upper 8 bits, which tell edges, are empty",
                     "save them with 8 bits, or multiply the values by 257");
    }
    const double ratio = (samples_.left_brightness + 1) / (samples_.right_brightness + 1);
    if (std::max(ratio, 1 / ratio) <= kMaxBrightness) return fine("images", text);
    add(Verdict::kNote, "images",
        text + fmt::format("; the left ones are {:.2f} times as bright as the right ones", ratio),
        "expose both cameras alike; the census cost bears it, sad3x3 does not");
  }

  void check_calibration() {
    const Calibration& c = sequence_.calibration;
    const std::string text = fmt::format("fx {:.1f}, fy {:.1f}, cx {:.1f}, cy {:.1f} px, baseline {:.4g} m", c.fx, c.fy,
                                         c.cx, c.cy, c.baseline_m);
    if (std::min(c.fx, c.fy) < 1 || c.baseline_m < 1e-6) {
      return problem("calibration", text, "no camera has such a focal length or baseline: give that of these images");
    }
    if (is_baseline_mistaken(c)) {
      return problem("calibration", text, kMistakenBaseline);
    }
    const bool centred = c.cx > 0.25 * size_.width && c.cx < 0.75 * size_.width && c.cy > 0.2 * size_.height &&
                         c.cy < 0.8 * size_.height;
    if (!centred) {
      return problem(
          "calibration",
          text + fmt::format(": the principal point is far from the middle of {}x{}", size_.width, size_.height),
          "give the calibration of images of this size: scale fx, fy, cx, cy as the images were scaled, and "
          "subtract what was cropped from cx, cy");
    }
    fine("calibration", text);
  }

  /// The rows of the two views: a constant offset, and what is left beside it.
  void check_rows() {
    const double offset = quantile(samples_.row_error, 0.5);
    std::vector<double> rest, places;
    for (const double error : samples_.row_error) rest.push_back(std::abs(error - offset));
    const double spread = quantile(rest, 0.9);
    const std::string text = fmt::format(
        "vertical misalignment {:.2f} px in the median, 90 % within {:.2f} px of it ({} in {}){}", offset, spread,
        counted(samples_.matches.size(), "point"), counted(samples_.frames, "frame"), slope_text(offset, spread));
    if (std::abs(offset) > kMaxOffset_px || spread > kMaxSpread_px) {
      return problem("rows", text,
                     fmt::format("{:.1f} px: rectify again (egosgm rectify, from the raw images and a new calibration)",
                                 std::max(std::abs(offset), spread)));
    }
    fine("rows", text);
  }

  /// How the misalignment changes from left to right and from top to bottom, by least squares.
  std::string slope_text(double offset, double spread) const {
    std::vector<cv::Vec3d> rows;
    std::vector<double> errors;
    for (std::size_t i = 0; i < samples_.matches.size(); ++i) {
      if (std::abs(samples_.row_error[i] - offset) > 3 * spread) continue;
      const cv::Point2f& at = samples_.matches[i].left;
      rows.emplace_back(1, at.x / size_.width, at.y / size_.height);
      errors.push_back(samples_.row_error[i]);
    }
    cv::Mat fit;
    const cv::Mat a(static_cast<int>(rows.size()), 3, CV_64F, rows.data());
    if (!cv::solve(a, cv::Mat(errors), fit, cv::DECOMP_SVD)) return {};
    return fmt::format(", {:+.2f} px from left to right, {:+.2f} px from top to bottom", fit.at<double>(1),
                       fit.at<double>(2));
  }

  /// A point before the cameras has d + doffs > 0.
  void check_sides() {
    const double doffs = sequence_.calibration.doffs_px;
    const double behind = share(samples_.disparity, [&](double d) { return d + doffs < -kBehind_px; });
    const std::string text = fmt::format("{:.1f} % of the points lie behind the cameras", 100 * behind);
    if (behind > 0.5) {
      return problem("sides", text, "left and right are swapped: exchange the images (and their calibrations)");
    }
    if (behind > kBehindShare) {
      return problem("sides", text,
                     "the principal points differ by more than doffs_px says, or the cameras converge: rectify again, "
                     "or give --min-disparity and doffs_px");
    }
    fine("sides", text);
  }

  void check_range() {
    const double low = quantile(samples_.disparity, 0.005), high = quantile(samples_.disparity, 0.995);
    const int least = options_.min_disparity, end = least + options_.disparities;
    const double above = share(samples_.disparity, [&](double d) { return d > end - 1; });
    const double below = share(samples_.disparity, [&](double d) { return d < least; });
    const std::string text = fmt::format(
        "disparities from {:.1f} to {:.1f} px (99 % of the points), the range is [{}, {})", low, high, least, end);
    const auto rounded_up = [](double value) { return 16 * static_cast<int>(std::ceil(value / 16)); };
    const double farthest = *std::max_element(samples_.disparity.begin(), samples_.disparity.end());
    if (above > kClippedShare) {
      problem("range", text + fmt::format(": it clips {:.1f} % of them, the near ones", 100 * above),
              fmt::format("give --disparities {}", rounded_up(1.1 * high - least + 1)));
    } else if (below > kClippedShare && high > 0) {
      problem("range", text + fmt::format(": it clips {:.1f} % of them, the far ones", 100 * below),
              fmt::format("give --min-disparity {}", static_cast<int>(std::floor(low)) - 2));
    } else if (2 * (farthest - least + 1) < options_.disparities) {
      add(Verdict::kNote, "range", text + ": half of it is never needed",
          fmt::format("--disparities {} is faster", rounded_up(1.25 * farthest - least + 1)));
    } else {
      fine("range", text);
    }
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
  const PipelineOptions& options_;
  const cv::Size size_;
  Samples samples_;
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
    sequence = arguments.input.open();
  } catch (const InvalidArgument& error) {
    // What the readers refuse is the diagnosis; a wrong sign of the baseline is one that they name.
    const std::string what = error.what();
    if (what.find("baseline") == std::string::npos) throw;
    return {{Verdict::kProblem, "calibration", what,
             "the calibration's right camera stands left of its left one: exchange the two cameras' rows; where the "
             "images are swapped, too, exchange them as well"}};
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
