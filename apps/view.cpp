// SPDX-License-Identifier: Apache-2.0
// Looks at a sequence while it is matched: in a window, as a video, as pictures.
#include <fmt/core.h>

#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "apps/command.h"
#include "apps/counted.h"
#include "apps/device_arguments.h"
#include "apps/doubt.h"
#include "apps/frame_panels.h"
#include "apps/interrupt.h"
#include "apps/last_ones.h"
#include "apps/media.h"
#include "apps/motion_source.h"
#include "apps/option_arguments.h"
#include "apps/output_folder.h"
#include "apps/progress.h"
#include "apps/sequence_arguments.h"
#include "apps/standard_output.h"
#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/opencv.h"
#include "egosgm/vision/window.h"
#include "host/vision/file_io.h"

namespace egosgm::app {
namespace {

struct ViewArguments {
  SequenceArguments input;
  OptionArguments method;
  StereoOdometryOptions odometry;
  std::string poses, device, programs, video, pictures;
  double frames_per_second = 10;
  int cell_width = 620;
  bool paused = false, quiet = false;
};

/// Matches one frame after the other and draws what came out.
class DrawnSequence {
 public:
  DrawnSequence(const ViewArguments& arguments, vision::StereoSequence sequence, const PipelineOptions& options)
      : cell_width_(arguments.cell_width),
        sequence_(std::move(sequence)),
        size_(vision::check_image_sizes(sequence_)),
        motions_(sequence_, arguments.poses, arguments.odometry),
        pipeline_(sequence_.calibration, size_.width, size_.height, options, device_of(arguments)),
        disparity_(size_, CV_32FC1),
        variance_(size_, CV_32FC1),
        search_width_(size_, CV_16UC1),
        panels_(options.disparities),
        input_(arguments.input.text()),
        doubt_(sequence_.calibration) {}

  std::size_t frames() const { return sequence_.frames.size(); }
  const std::string& note() const { return sequence_.note; }
  const std::string& name(std::size_t i) const { return sequence_.frames[i].name; }

  /// REQUIRES: called for frames 0, 1, 2, ... of the sequence.
  cv::Mat draw(std::size_t i) {
    const vision::StereoFrame& frame = sequence_.frames[i];
    const vision::StereoImages images = vision::read_images(frame);
    const std::optional<Motion> motion = motions_.next(images).motion;
    FrameOutputs outputs;
    outputs.disparity = vision::map_view(disparity_);
    outputs.variance = vision::map_view(variance_);
    outputs.debug.search_width = {search_width_.ptr<std::uint16_t>(), size_.width, size_.height,
                                  static_cast<std::ptrdiff_t>(search_width_.step)};
    report_ = pipeline_.process(vision::image_view(images.left), vision::image_view(images.right), motion, outputs);
    doubt_.add(report_.density, motion.has_value(), vision::holds_8_bits_in_16(images.left));
    return panels_.all({frame, images.left, disparity_, variance_, search_width_}, cell_width_);
  }

  std::string summary(std::size_t i) const {
    return fmt::format("frame {}  search {:5.1f} %  density {:5.1f} %  {:.0f} ms", name(i),
                       100 * std::min(1.0, report_.search_fraction), 100 * report_.density, report_.total_ms);
  }

  /// Names egosgm doctor where something speaks against the input; else empty.
  std::string advice() const { return advice_of(doubt_.text(), input_); }

 private:
  static Device device_of(const ViewArguments& arguments) {
    const Device device = Device::select(arguments.device);
    return arguments.programs.empty() ? device : device.with_programs(arguments.programs);
  }

  const int cell_width_;
  const vision::StereoSequence sequence_;
  const cv::Size size_;
  MotionSource motions_;
  Pipeline pipeline_;
  cv::Mat disparity_, variance_, search_width_;
  FramePanels panels_;
  FrameReport report_;
  const std::string input_;
  Doubt doubt_;
};

/// Throws InvalidArgument where a video cannot get this name.
void expect_video(const std::filesystem::path& file) {
  if (file.extension() != ".mp4" && file.extension() != ".avi")
    throw InvalidArgument("--video " + file.string() + ": the name must end in .mp4 or .avi");
  vision::make_folder(std::filesystem::absolute(file).parent_path());
  expect_new_file("--video", file.string());
}

/// A video that appears under its name once it is whole.
class VideoFile {
 public:
  VideoFile(std::filesystem::path file, double frames_per_second)
      : file_(std::move(file)), frames_per_second_(frames_per_second) {
    std::string folder = (std::filesystem::absolute(file_).parent_path() / ".egosgm-XXXXXX").string();
    if (!::mkdtemp(folder.data())) {
      throw IoError(file_.string() + ": cannot be written: " + std::generic_category().message(errno));
    }
    unfinished_ = std::filesystem::path(folder) / ("video" + file_.extension().string());
  }
  ~VideoFile() {
    std::error_code ignored;
    std::filesystem::remove(unfinished_, ignored);
    std::filesystem::remove(unfinished_.parent_path(), ignored);
  }
  VideoFile(const VideoFile&) = delete;
  VideoFile& operator=(const VideoFile&) = delete;

  void add(const cv::Mat& picture) {
    cv::Mat even;  // the codecs want even sides
    cv::copyMakeBorder(picture, even, 0, picture.rows % 2, 0, picture.cols % 2, cv::BORDER_CONSTANT);
    if (!writer_) {
      const bool mp4 = file_.extension() == ".mp4";
      writer_ = media().create_video(unfinished_.string(), mp4 ? "mp4v" : "MJPG", frames_per_second_, even.size());
      if (!writer_) {
        throw IoError(file_.string() + ": OpenCV cannot write this video: " +
                      (mp4 ? "give a name that ends in .avi, or use --pictures" : "use --pictures"));
      }
    }
    writer_->write(even);
    ++written_;
  }

  void finish() {
    if (!writer_) return;
    writer_->release();
    expect_whole();
    vision::move_file(unfinished_, file_);
  }

 private:
  /// OpenCV's writer does not say where the disk is full.
  void expect_whole() const {
    int found = 0;
    if (const auto video = media().open_video(unfinished_.string())) {
      while (video->grab()) ++found;
    }
    if (found == written_) return;
    throw IoError(
        fmt::format("{}: cannot be written: of {} only {} could be read back; free some space, or use --pictures",
                    file_.string(), counted(static_cast<std::size_t>(written_), "frame"), found));
  }

  const std::filesystem::path file_;
  const double frames_per_second_;
  std::filesystem::path unfinished_;
  std::unique_ptr<cv::VideoWriter> writer_;
  int written_ = 0;
};

int write_files(DrawnSequence& drawn, const ViewArguments& arguments) {
  const vision::KeepFiles others;
  std::optional<VideoFile> video;
  if (!arguments.video.empty()) video.emplace(arguments.video, arguments.frames_per_second);
  if (!arguments.pictures.empty()) vision::make_folder(arguments.pictures);
  std::size_t i = 0;
  {
    Progress progress(static_cast<int>(drawn.frames()), arguments.quiet);
    for (; i < drawn.frames() && !interrupted(); ++i) {
      const cv::Mat picture = drawn.draw(i);
      if (video) video->add(picture);
      if (!arguments.pictures.empty())
        vision::write_png(std::filesystem::path(arguments.pictures) / (drawn.name(i) + ".png"), picture);
      progress.done(drawn.summary(i));
    }
  }
  if (video) video->finish();
  if (i == drawn.frames()) return kOk;
  say(fmt::format("egosgm: interrupted after {} of {} frames: what was written is whole", i, drawn.frames()));
  return kInterrupted;
}

/// The window: plays, pauses, and steps through what was drawn last.
class Window {
 public:
  Window(DrawnSequence& drawn, const ViewArguments& arguments)
      : drawn_(drawn), playing_(!arguments.paused), delay_ms_(std::max(1, int(1000 / arguments.frames_per_second))) {
    window_.open_window(kName, cv::WINDOW_NORMAL | cv::WINDOW_KEEPRATIO);
  }
  ~Window() { window_.close_windows(); }
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  int operator()() {
    show(0);
    window_.resize_window(kName, pictures_[0].size());
    while (!interrupted() && is_open()) {
      const int key = window_.wait_for_key(playing_ ? delay_ms_ : 50);
      if (is_quit(key) || !is_open()) break;
      if (key == ' ') playing_ = !playing_;
      if (is_step_back(key) && at_ > pictures_.first()) playing_ = false, show(at_ - 1);
      if (is_step(key)) playing_ = false;
      if ((playing_ || is_step(key)) && at_ + 1 < drawn_.frames()) show(at_ + 1);
    }
    return interrupted() ? kInterrupted : kOk;
  }

 private:
  static constexpr const char* kName = "egosgm: space plays or pauses, right and left step, q quits";
  static bool is_quit(int key) { return key >= 0 && ((key & 0xff) == 'q' || (key & 0xff) == 27) && !is_arrow(key); }
  static bool is_arrow(int key) { return (key & 0xff00) == 0xff00; }  // X11's, as all of OpenCV's windows give them
  static bool is_step(int key) { return key == 'n' || (is_arrow(key) && (key & 0xff) == 0x53); }
  static bool is_step_back(int key) { return key == 'p' || (is_arrow(key) && (key & 0xff) == 0x51); }
  bool is_open() const { return window_.window_property(kName, cv::WND_PROP_VISIBLE) >= 1; }

  void show(std::size_t i) {
    while (pictures_.end() <= i) pictures_.push_back(drawn_.draw(pictures_.end()));
    at_ = i;
    window_.show(kName, pictures_[i]);
  }

  const Media& window_ = media();
  DrawnSequence& drawn_;
  bool playing_;
  const int delay_ms_;
  LastOnes<cv::Mat> pictures_{100};  // some 150 MB of KITTI's size
  std::size_t at_ = 0;
};

void require_display() {
  constexpr const char* kRemedy = "give --video FILE.mp4 or --pictures DIR";
  const auto open_window = [] {
    media().open_window("egosgm", cv::WINDOW_AUTOSIZE);
    media().close_windows();
  };
  try {
    if (vision::has_display(open_window)) return;
  } catch (const InvalidArgument& error) {
    throw InvalidArgument(fmt::format("{}, or {}", error.what(), kRemedy));
  }
  throw InvalidArgument(fmt::format("there is no display (DISPLAY is not set): {}", kRemedy));
}

int view(const ViewArguments& arguments) {
  if (!(arguments.frames_per_second > 0 && arguments.frames_per_second <= 1000))
    throw InvalidArgument(fmt::format("--fps {}: choose a number above 0, up to 1000", arguments.frames_per_second));
  if (arguments.cell_width < 1 || arguments.cell_width > vision::kMaxImageSide)
    throw InvalidArgument(fmt::format("--cell-width {}: choose 1 to {}", arguments.cell_width, vision::kMaxImageSide));
  const bool window = arguments.video.empty() && arguments.pictures.empty();
  catch_interrupts();
  if (window) require_display();
  vision::StereoSequence sequence = arguments.input.open();
  const PipelineOptions options = arguments.method.options();
  arguments.method.expect_saves(arguments.pictures);
  if (!arguments.pictures.empty()) new_folder("--pictures", arguments.pictures, Inputs(arguments.input, sequence));
  if (!arguments.video.empty()) expect_video(arguments.video);
  DrawnSequence drawn(arguments, std::move(sequence), options);
  arguments.method.save(options);
  if (!arguments.quiet && !drawn.note().empty()) print_now(drawn.note() + '\n');
  const int code = window ? Window(drawn, arguments)() : write_files(drawn, arguments);
  if (!arguments.quiet && !drawn.advice().empty()) fmt::print("{}\n", drawn.advice());
  return code;
}

}  // namespace

Command add_view(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("view", "Look at a sequence while it is matched: in a window, as a video, as pictures");
  auto arguments = std::make_shared<ViewArguments>();
  arguments->input.add_to(*command);
  const char* group = "Output (default: a window)";
  command->add_option("--video", arguments->video, "write a new video in place of the window")
      ->type_name("FILE.mp4")
      ->group(group);
  command
      ->add_option("--pictures", arguments->pictures, "write DIR/NNNNNN.png, DIR a new folder, in place of the window")
      ->type_name("DIR")
      ->group(group);
  command->add_option("--fps", arguments->frames_per_second, "frames per second, at most")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  command->add_option("--cell-width", arguments->cell_width, "width of a panel [px], two stand in a row")
      ->type_name("N")
      ->capture_default_str()
      ->group(group);
  command->add_flag("--paused", arguments->paused, "start with the first frame, paused")->group(group);
  command->add_flag("--quiet", arguments->quiet, "no progress, only errors")->group(group);
  arguments->method.add_to(*command);
  add_motion(*command, arguments->poses, arguments->odometry);
  add_device(*command, arguments->device);
  add_programs(*command, arguments->programs);
  return {command, [arguments] { return view(*arguments); }};
}

}  // namespace egosgm::app
