// SPDX-License-Identifier: Apache-2.0
#include "apps/run_sequence.h"

#include <fmt/core.h>

#include <chrono>
#include <utility>

#include "apps/counted.h"
#include "apps/interrupt.h"
#include "apps/option_arguments.h"
#include "apps/progress.h"
#include "apps/run_outputs.h"
#include "apps/standard_output.h"
#include "apps/trace.h"
#include "egosgm/error.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/poses_io.h"
#include "vision/file_io.h"
#include "vision/stereo_video.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

constexpr const char *kKilled = "a kill, or it is still running", *kInterrupt = "an interrupt";

constexpr std::uint64_t kManyMib = 1024;  // from there on what the device holds is told

constexpr const char* kNoCalibration =
    "no calibration was given: disparities are there, but no depth and no odometry; --calib FILE brings both";

using Clock = std::chrono::steady_clock;
std::string note_of(const FrameReport& report) {
  if (report.repeated) return "  (repeated pictures)";
  if (!report.searched_everything && !report.unpredicted) return "";
  const std::string why =
      !report.unpredicted ? "searched everything" : fmt::format("no prediction: {}", to_string(report.unpredicted));
  return report.search_fraction < 1.01 ? fmt::format("  ({})", why)
                                       : fmt::format("  ({}; matched {:.2g} times)", why, report.search_fraction);
}

std::string text_of(const CloudCounts& clouds, const vision::PointCloudOptions& bounds) {
  const vision::LeftOut& out = clouds.left_out;
  const double all = static_cast<double>(clouds.points + out.far + out.uncertain + out.alone);
  const auto percent = [all](std::int64_t pixels) { return 100 * static_cast<double>(pixels) / std::max(1.0, all); };
  return fmt::format(
      "clouds hold {:.1f} % of the pixels with a disparity; left out: {:.1f} % uncertain by more than {:g} % "
      "(--cloud-sigma), {:.1f} % farther than {:g} m, {:.1f} % without a neighbour",
      percent(clouds.points), percent(out.uncertain), 100 * bounds.max_relative_sigma, percent(out.far),
      bounds.max_depth_m, percent(out.alone));
}

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

class Run {
 public:
  Run(const SequenceJob& job, const Device& device)
      : quiet_(job.quiet),
        folder_(job.out),
        save_config_(job.save_config),
        source_(*job.source),
        sink_(job.sink.get()),
        sequence_(source_.sequence()),
        cloud_options_(job.cloud),
        input_(job.input),
        size_(source_.size()),
        motions_(sequence_, job.poses_file, job.odometry),
        waiting_(std::in_place,
                 fmt::format("compiling the kernels for {}, which its driver keeps if it can", device.info().name),
                 quiet_),
        pipeline_(sequence_.calibration, size_.width, size_.height, job.options, device, source_.type()),
        report_(sequence_, pipeline_, motion_of(job), size_.width, size_.height),
        // With a device of its own, the next pair is read while this frame is written; on a CPU device one more thread
        // would only take the kernels' cores.
        video_(motions_, pipeline_,
               {.calibration = sequence_.has_calibration ? std::optional(sequence_.calibration) : std::nullopt,
                .outputs = [this] { return outputs_->views(); },
                .is_interrupted = interrupted,
                .reads_ahead = device.info().type != DeviceType::kCpu},
               &source_) {
    if (job.lost) report_.take_over(*job.lost);
    if (has_folder()) folder_.begin(report_.identity());
    if (job.kinds.contains("reason")) report_.add_reasons();
    outputs_.emplace(folder_.path(), job.kinds, size_, job.options, sequence_.calibration, cloud_options_);
    if (sink_ && job.sink_takes_all) outputs_->make_maps({Output::kVariance, Output::kReason});
    if (job.trace.empty()) return;
    trace_.emplace(job.trace);
    pipeline_.record_commands(true);
  }

  bool operator()() {
    const vision::BeforeWrite recording(
        [this](const auto& file, auto bytes) { return folder_.is_to_write(file, bytes); });
    take_folder();
    try {
      save_config();
      pipeline_.prepare(source_.type(), outputs_->views());
      waiting_.reset();
      if (has_folder() && source_.has_no_files() && sequence_.has_calibration) {
        vision::write_calibration(folder_.path() / kRunCalibration, sequence_.calibration);
      }
      if (sink_) sink_->begin(pipeline_.options(), sequence_.calibration);
      const bool finished = process_all();
      finish(finished, finished ? "" : kInterrupt);
      if (!finished) {
        say(has_folder() ? fmt::format("egosgm: interrupted after {} of {} frames: what is in {} is whole",
                                       poses_.size(), sequence_.frames.size(), folder_.path().string())
                         : "egosgm: interrupted");
      }
      return finished;
    } catch (const std::exception& error) {
      finish_after(interrupted() ? kInterrupt : error.what());
      if (has_folder() && poses_.empty() && !interrupted()) folder_.leave_nothing();
      throw;
    }
  }

 private:
  void save_config() const {
    const vision::KeepFiles others;
    if (!save_config_.empty()) vision::write_file(save_config_, config_text(pipeline_.options()));
  }

  bool has_folder() const { return !folder_.path().empty(); }

  /// By the first report: of two runs that began together in one new folder, one finds the other's, and leaves it.
  void take_folder() {
    std::optional<vision::KeepFiles> others;
    if (has_folder() && !folder_.goes_on()) {
      folder_.expect_no_other_run();
      others.emplace();
    }
    write_report(false, kKilled);
  }

  static std::string motion_of(const SequenceJob& job) {
    if (!job.source->sequence().has_calibration) return "none: the images have no calibration";
    if (!job.poses_file.empty()) return "poses of " + job.poses_file;
    if (const std::string poses = job.source->poses(); !poses.empty()) return "poses of " + poses;
    return fmt::format("stereo odometry, at most {} m and {} degrees a frame", job.odometry.max_translation_m,
                       job.odometry.max_rotation_deg);
  }

  bool process_all() {
    Progress progress(static_cast<int>(sequence_.frames.size()), quiet_);
    if (!sequence_.note.empty()) note(sequence_.note, progress);
    if (!sequence_.has_calibration) progress.note(kNoCalibration);
    if (const std::uint64_t mib = pipeline_.device_memory_bytes() >> 20; mib >= kManyMib) {
      progress.note(
          fmt::format("{} MiB of the device are in use; --set max_memory_mib=N bounds the matcher's part", mib));
    }
    while (const std::optional<vision::VideoFrame> frame = video_.next()) {
      if (frame->pair.unreadable.empty()) {
        take(*frame, progress);
      } else {
        leave_out(frame->pair, progress);
      }
    }
    if (!quiet_) summary_ = fmt::format("{:.1f} frames/s", progress.frames_per_second());
    return video_.is_complete();
  }

  void leave_out(const vision::VideoPair& pair, Progress& progress) {
    const fs::path map = folder_.path() / output_file("disparity", pair.frame.name, pipeline_.options());
    if (has_folder() && fs::exists(map)) {
      throw InvalidArgument(
          fmt::format("--resume: {} is there, but its pair cannot be read any more: {}; give another "
                      "--out",
                      map.string(), pair.unreadable));
    }
    report_.leave_out(pair.frame, pair.unreadable);
    progress.note(fmt::format("frame {}: left out: {}", pair.frame.name, pair.unreadable));
    progress.done(fmt::format("frame {}  left out", pair.frame.name));
  }

  /// Writes and reports a frame.
  void take(const vision::VideoFrame& made, Progress& progress) {
    const vision::StereoFrame& frame = made.pair.frame;
    const auto before_write = Clock::now();
    const WrittenFrame written =
        has_folder() ? outputs_->write(frame, made.pair.images.left, made.motion.motion) : WrittenFrame();
    if (sink_) sink_->take(made, outputs_->shown());
    if (written.cloud) add(*written.cloud);
    const HostTimes times{made.read_ms, ms_since(before_write), ms_since(last_written_)};
    last_written_ = Clock::now();
    if (trace_) trace(made, before_write, times.write_ms);
    report_.add(made, times, written);
    poses_.push_back(made.motion.first_from_camera);
    tell(made, times, written, progress);
  }

  void add(const CloudCounts& cloud) {
    if (!clouds_) clouds_.emplace();
    clouds_->points += cloud.points;
    clouds_->left_out.far += cloud.left_out.far;
    clouds_->left_out.uncertain += cloud.left_out.uncertain;
    clouds_->left_out.alone += cloud.left_out.alone;
  }

  void trace(const vision::VideoFrame& made, Clock::time_point before_write, double write_ms) {
    const std::string& frame = made.pair.frame.name;
    trace_->add_host("read", frame, Trace::Row::kPrepare, made.read_start, made.read_ms);
    if (!made.motion.is_given) {
      trace_->add_host("odometry", frame, Trace::Row::kPrepare, made.odometry_start, made.motion.odometry_ms);
    }
    trace_->add_device(made.report.commands, frame);
    trace_->add_host("write", frame, Trace::Row::kWrite, before_write, write_ms);
  }

  void tell(const vision::VideoFrame& made, const HostTimes& times, const WrittenFrame& written, Progress& progress) {
    const vision::StereoFrame& frame = made.pair.frame;
    const FrameReport& result = made.report;
    if (sequence_.has_calibration && poses_.size() > 1 && !made.motion.motion) {
      progress.note(
          fmt::format("frame {}: no motion ({}): searched the full range", frame.name, made.motion.odometry.reason));
    }
    repeated_ += result.repeated;
    if (written.unstorable > 0 && !warned_of_range_) {
      warned_of_range_ = true;
      note(fmt::format(
               "frame {}: {} disparities lie outside KITTI's PNG (0 to 256 px) and are missing there: add --write pfm",
               frame.name, written.unstorable),
           progress);
    }
    if (written.too_far > 0 && !warned_of_depth_) {
      warned_of_depth_ = true;
      note(fmt::format(
               "frame {}: {} depths beyond 65.535 m have no room in OUT/depth and are 0 there: add --write depth_m",
               frame.name, written.too_far),
           progress);
    }
    progress.done(fmt::format("frame {}  search {:5.1f} %  density {:5.1f} %  {:.0f} ms{}", frame.name,
                              100 * std::min(1.0, result.search_fraction), 100 * result.density, times.wall_ms,
                              note_of(result)));
  }

  /// Told at once, or at the end where quiet; the report has it, too.
  void note(const std::string& text, Progress& progress) {
    progress.note(text);
    notes_.push_back(text);
  }

  void finish(bool finished, const std::string& why_not) {
    if (sink_) sink_->end(finished);
    const std::string warning = video_.warning(), of_poses = video_.warning_of_poses();
    const std::size_t told = notes_.size();
    if (repeated_ > 0) {
      notes_.push_back(fmt::format("{} the pictures of the frame before: the camera is taken to stand there",
                                   repeated_ == 1 ? "1 frame repeats" : counted(repeated_, "frame") + " repeat"));
    }
    for (std::string& of_feed : source_.notes()) notes_.push_back(std::move(of_feed));
    report_.set_warning(warning.empty() || of_poses.empty() ? warning + of_poses : warning + "; " + of_poses, notes_);
    if (has_folder() && sequence_.has_calibration && !poses_.empty())
      vision::write_poses(folder_.path() / "poses.txt", poses_);
    if (const auto objects = outputs_->objects(); has_folder() && objects && !poses_.empty()) {
      vision::write_file(folder_.path() / kRunObjects, *objects);
    }
    write_report(finished, why_not);
    if (const std::optional<Trace> trace = std::exchange(trace_, std::nullopt)) write_trace(*trace);
    if (!finished) return;
    if (quiet_) {
      if (video_.left_out() > 0) say("egosgm: " + video_.text_of_left_out());
      for (const std::string& note : notes_) say("egosgm: " + note);
      return;
    }
    fmt::print("{}, {}, {}x{}, on {}\n", sequence_.title, counted(poses_.size(), "frame"), size_.width, size_.height,
               pipeline_.device().info().name);
    fmt::print("{}, search {:.1f} % and density {:.1f} % in the mean{}{}\n", summary_,
               100 * report_.mean("search_fraction"), 100 * report_.mean("density"), has_folder() ? ": " : "",
               folder_.path().string());
    if (video_.left_out() > 0) fmt::print("{}\n", video_.text_of_left_out());
    if (clouds_) fmt::print("{}\n", text_of(*clouds_, cloud_options_));
    for (std::size_t i = told; i < notes_.size(); ++i) fmt::print("{}\n", notes_[i]);
    if (!of_poses.empty()) fmt::print("{}\n", of_poses);
    if (!warning.empty()) fmt::print("{}: `egosgm doctor {}` tells why\n", warning, input_);
  }

  void write_trace(const Trace& trace) {
    trace.write();
    if (trace.has_device_times() || quiet_) return;
    fmt::print("{} gives no times of commands: the trace has those of the host only\n", pipeline_.device().info().name);
  }

  /// The report of a run that lacks nothing stays until this one is found equal.
  void write_report(bool finished, const std::string& why_not) {
    if (!has_folder() || (!finished && folder_.lacks_nothing())) return;
    report_.write(folder_.path() / "report.json", finished, why_not);
  }

  /// The first error counts; that something cannot be written either adds nothing.
  void finish_after(const std::string& why) {
    try {
      finish(false, why);
    } catch (const std::exception&) {
      try {
        write_report(false, why);
      } catch (const std::exception&) {
      }
    }
  }

  const bool quiet_;
  OutputFolder folder_;
  const fs::path save_config_;
  vision::FrameSource& source_;
  FrameSink* const sink_;
  const vision::StereoSequence& sequence_;
  const vision::PointCloudOptions cloud_options_;
  std::optional<CloudCounts> clouds_;  // of all frames
  const std::string& input_;
  const vision::Size size_;
  vision::MotionSource motions_;
  std::optional<RunOutputs> outputs_;  // frames under way are written to it: the pipeline goes first
  std::optional<Waiting> waiting_;     // until all is built
  Pipeline pipeline_;
  RunReport report_;
  vision::StereoVideo video_;
  std::optional<Trace> trace_;
  Clock::time_point last_written_ = Clock::now();
  std::vector<Isometry> poses_;
  std::string summary_;
  std::vector<std::string> notes_;
  int repeated_ = 0;  // frames
  bool warned_of_range_ = false, warned_of_depth_ = false;
};

}  // namespace

bool run_sequence(const SequenceJob& job, const Device& device) { return Run(job, device)(); }

}  // namespace egosgm::app
