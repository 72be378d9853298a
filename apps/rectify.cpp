// SPDX-License-Identifier: Apache-2.0
// Raw pairs in, a rectified sequence out, in the layout that all other commands read.
#include <fmt/core.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/interrupt.h"
#include "apps/output_folder.h"
#include "apps/progress.h"
#include "apps/raw_pairs.h"
#include "apps/sequence_arguments.h"
#include "apps/standard_output.h"
#include "egosgm/error.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/rectification.h"
#include "host/vision/doubt.h"
#include "host/vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

struct RectifyArguments {
  RawPairArguments input;
  std::string calib, out, unit, pair_by;
  double alpha = 0;
  bool is_fisheye = false;
  bool quiet = false;
};

double metres_in(const std::string& unit) {
  if (unit.empty() || unit == "m") return 1;
  if (unit == "cm") return 0.01;
  if (unit == "mm") return 0.001;
  throw InvalidArgument("--unit " + unit + ": choose m, cm or mm");
}

/// mav0, where the folder of an EuRoC sequence is given.
fs::path mav0_of(const fs::path& folder) { return fs::is_directory(folder / "mav0") ? folder / "mav0" : folder; }

/// What a pair goes through: rectification, or nothing where the images are rectified already.
class Rectifier {
 public:
  explicit Rectifier(const RectifyArguments& arguments) : arguments_(arguments) {
    if (!arguments.input.euroc.empty()) {
      rig_ = vision::read_euroc_rig(mav0_of(arguments.input.euroc));
      return;
    }
    if (arguments.calib.empty()) throw InvalidArgument("no calibration: give --calib FILE");
    rig_ = vision::read_opencv_rig(arguments.calib, metres_in(arguments.unit), arguments.is_fisheye);
    if (!rig_ && arguments.is_fisheye) {
      throw InvalidArgument("--fisheye: " + arguments.calib + " is no calibration of OpenCV's (K1, D1, K2, D2, R, T)");
    }
    if (!rig_) calibration_ = vision::read_calibration(arguments.calib);
    if (rig_ && arguments.unit.empty()) expect_metres();
  }

  bool rectifies() const { return rig_.has_value(); }

  void operator()(RawPair& pair) {
    if (!rig_) return;
    if (!rectification_) {
      rectification_ = vision::rectification_of(*rig_, pair.left.size(), arguments_.alpha);
      calibration_ = rectification_->calibration;
    }
    pair.left = vision::rectify(pair.left, rectification_->left_map);
    pair.right = vision::rectify(pair.right, rectification_->right_map);
  }

  const Calibration& calibration() const { return calibration_; }
  const std::optional<vision::Rectification>& rectification() const { return rectification_; }

 private:
  /// Only who names the unit has a baseline that no two cameras have.
  void expect_metres() const {
    const double baseline_m = cv::norm(rig_->T);
    const auto suspicion =
        std::isfinite(baseline_m) && baseline_m > 1e-3 ? vision::suspect_baseline(baseline_m) : std::nullopt;
    if (!suspicion) return;
    throw InvalidArgument(
        fmt::format("{}: T gives {}: {} Give --unit cm or --unit mm, whichever it is, or --unit m where it is "
                    "right",
                    arguments_.calib, suspicion->what, suspicion->remedy));
  }

  const RectifyArguments& arguments_;
  std::optional<vision::StereoRig> rig_;
  std::optional<vision::Rectification> rectification_;
  Calibration calibration_;
};

/// KITTI odometry's layout; colour goes to image_2 and image_3.
class SequenceFolder {
 public:
  /// REQUIRES: a new or empty folder.
  explicit SequenceFolder(const fs::path& folder) : folder_(folder) {}

  void add(const RawPair& pair) {
    if (frames_ > 0 && pair.left.size() != size_) {
      throw InvalidArgument(fmt::format("pair {} is {}x{}, the pairs before {}x{}: all need one size", frames_ + 1,
                                        pair.left.cols, pair.left.rows, size_.width, size_.height));
    }
    if (frames_ == 0) {
      size_ = pair.left.size();
      colour_ = pair.left.channels() > 1;
      for (const char* side : {left(), right()}) vision::make_folder(folder_ / side);
    }
    const std::string name = fmt::format("{:06}.png", frames_);
    vision::write_png(folder_ / left() / name, writable(pair.left));
    vision::write_png(folder_ / right() / name, writable(pair.right));
    if (pair.time_s)
      times_ += fmt::format("{:.9f}\n", *pair.time_s);
    else
      timeless_ = true;
    ++frames_;
  }

  void finish(const Rectifier& rectifier) {
    if (frames_ == 0) throw InvalidArgument("the input has no pair: is it empty?");
    vision::write_calibration(folder_ / "calib.txt", rectifier.calibration());
    if (!timeless_) vision::write_file(folder_ / "times.txt", times_);
    if (rectifier.rectification()) vision::write_png(folder_ / "valid.png", rectifier.rectification()->valid);
  }

  int frames() const { return frames_; }

 private:
  const char* left() const { return colour_ ? "image_2" : "image_0"; }
  const char* right() const { return colour_ ? "image_3" : "image_1"; }

  /// PNGs here are grey of 8 or 16 bits, or colour of 8.
  cv::Mat writable(const cv::Mat& image) const {
    cv::Mat result = image;
    if (colour_ && result.channels() == 1) cv::cvtColor(image, result, cv::COLOR_GRAY2BGR);
    if (!colour_ && result.channels() > 1) cv::cvtColor(image, result, cv::COLOR_BGR2GRAY);
    if (result.channels() > 1 && result.depth() == CV_16U) result.convertTo(result, CV_8U, 1.0 / 257);
    return result;
  }

  const fs::path folder_;
  cv::Size size_;
  bool colour_ = false, timeless_ = false;
  int frames_ = 0;
  std::string times_;
};

std::string rectangle_text(const cv::Rect& r) {
  return fmt::format("{}x{} from ({}, {})", r.width, r.height, r.x, r.y);
}

int rectify(const RectifyArguments& arguments) {
  if (!(arguments.alpha >= 0 && arguments.alpha <= 1)) {
    throw InvalidArgument(fmt::format("--alpha {}: choose from 0 to 1", arguments.alpha));
  }
  RawPairArguments input = arguments.input;
  input.pair_by = parse_pair_by(arguments.pair_by);
  if (!input.euroc.empty()) input.euroc = mav0_of(input.euroc);
  const std::unique_ptr<RawPairs> pairs = open_pairs(input);
  Rectifier rectifier(arguments);
  SequenceFolder folder(new_folder("--out", arguments.out));
  const vision::KeepFiles others;
  catch_interrupts();
  try {
    Progress progress(pairs->count(), arguments.quiet);
    const std::string note = pairs->note();
    if (!note.empty()) progress.note(note);
    for (std::optional<RawPair> pair; !interrupted() && (pair = pairs->next());) {
      rectifier(*pair);
      folder.add(*pair);
      progress.done(fmt::format("pair {}", folder.frames()));
    }
    if (pairs->note() != note) progress.note(pairs->note());
  } catch (const std::exception&) {  // what was written until then is a sequence of its own
    if (folder.frames() > 0) folder.finish(rectifier);
    throw;
  }
  if (interrupted() && folder.frames() == 0) {
    say("egosgm: interrupted before the first pair");
    return kInterrupted;
  }
  folder.finish(rectifier);
  if (!arguments.quiet) {
    const Calibration& c = rectifier.calibration();
    fmt::print("{} in {}: fx {:.2f} px, baseline {:.4f} m{}\n", counted(folder.frames(), "pair"), arguments.out, c.fx,
               c.baseline_m, rectifier.rectifies() ? "" : "; they were rectified already");
    if (const auto& rectification = rectifier.rectification()) {
      fmt::print("valid: left {}, right {} (valid.png has the left one's pixels)\n",
                 rectangle_text(rectification->valid_left), rectangle_text(rectification->valid_right));
    }
    fmt::print("egosgm doctor {0}; egosgm run --odometry {0} --out OUT\n", shell_word(arguments.out));
  }
  if (!interrupted()) return kOk;
  say(fmt::format("egosgm: interrupted after {}: what is in {} is whole",
                  counted(static_cast<std::size_t>(folder.frames()), "pair"), arguments.out));
  return kInterrupted;
}

}  // namespace

Command add_rectify(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "rectify", "Make a rectified sequence of raw pairs, side-by-side images or videos, EuRoC folders, lists");
  auto arguments = std::make_shared<RectifyArguments>();
  const char* group = "Input (one of)";
  RawPairArguments& input = arguments->input;
  command
      ->add_option("--left", input.left,
                   "left images: a file, a pattern such as 'left/*.jpg' or 'left/%06d.png', or a video")
      ->type_name("PATTERN")
      ->group(group);
  command->add_option("--right", input.right, "right images, likewise")->type_name("PATTERN")->group(group);
  add_pair_by(*command, arguments->pair_by, group);
  command
      ->add_option("--side-by-side", input.side_by_side,
                   "images or a video with the left view in the left half and the right one in the right half")
      ->type_name("PATTERN")
      ->group(group);
  command->add_option("--list", input.list, "a text file with rows LEFT RIGHT or LEFT RIGHT SECONDS")
      ->type_name("FILE")
      ->group(group);
  command->add_option("--euroc", input.euroc, "an EuRoC sequence (mav0 or its parent), with its own calibration")
      ->type_name("DIR")
      ->group(group);
  command
      ->add_option(
          "--calib", arguments->calib,
          "OpenCV's stereo calibration (M1, D1, M2, D2, R, T; YAML, XML or JSON), a folder with intrinsics.yml "
          "and extrinsics.yml, or, for images that are rectified already, what `run --calib` reads")
      ->type_name("FILE");
  command->add_flag("--fisheye", arguments->is_fisheye,
                    "OpenCV's calibration is one of cv::fisheye: D1 and D2 hold four coefficients of the angle");
  command->add_option("--unit", arguments->unit, "unit of T in OpenCV's calibration [m]")->type_name("m|cm|mm");
  command
      ->add_option("--alpha", arguments->alpha,
                   "0: only pixels that the raw images have; 1: all of theirs, with black borders")
      ->type_name("A")
      ->capture_default_str();
  command
      ->add_option("--out", arguments->out,
                   "new folder: image_0 and image_1 (colour: image_2, image_3), calib.txt, times.txt, valid.png")
      ->type_name("DIR")
      ->required();
  command->add_flag("--quiet", arguments->quiet, "no progress, only errors");
  return {command, [arguments] { return rectify(*arguments); }};
}

}  // namespace egosgm::app
