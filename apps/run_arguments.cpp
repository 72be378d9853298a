// SPDX-License-Identifier: Apache-2.0
#include "apps/run_arguments.h"

#include <fmt/core.h>

#include <CLI/App.hpp>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "apps/device_arguments.h"
#include "apps/frame_sink.h"
#include "apps/option_group.h"
#include "apps/output_folder.h"
#include "apps/run_outputs.h"
#include "apps/tuning_file.h"
#include "egosgm/error.h"
#include "vision/file_kinds.h"
#include "vision/frame_panels.h"
#include "vision/motion_source.h"

namespace egosgm::app {
namespace {

std::shared_ptr<vision::FrameSource> source_of(const RunArguments& arguments, const Package& package) {
  const std::optional<VideoArguments> videos = arguments.input.videos();
  if (arguments.bag.bag.empty() && !videos) {
    return std::make_shared<vision::FileSource>(
        arguments.input.open(/*needs_calibration=*/false, package.read_calibration));
  }
  const vision::FrameRange range =
      arguments.input.frames.empty() ? vision::FrameRange{} : vision::parse_frame_range(arguments.input.frames);
  if (arguments.bag.bag.empty()) return package.open_videos(*videos, arguments.input.calib, range, arguments.out);
  SequenceArguments others = arguments.input;
  others.calib = others.frames = "";
  if (!others.text().empty()) {
    throw InvalidArgument("more than one input: --bag " + arguments.bag.bag + " and " + others.text() +
                          ": give one of them");
  }
  return package.open_bag(arguments.bag, arguments.input.calib, range, arguments.out);
}

/// Throws InvalidArgument for what only a folder takes, or for what the frames have not.
void expect_takeable(const RunArguments& arguments, const SequenceJob& job) {
  const vision::StereoSequence& sequence = job.source->sequence();
  for (const char* kind : {"cloud", "depth", "depth_m"}) {
    if (sequence.has_calibration || !job.kinds.contains(kind)) continue;
    throw InvalidArgument(
        fmt::format("--write {}: a disparity is no depth without a calibration: give --calib FILE", kind));
  }
  for (const char* kind : {"flow", "disp_1", "objects"}) {
    if (!job.kinds.contains(kind)) continue;
    if (!sequence.has_calibration) {
      throw InvalidArgument(
          fmt::format("--write {}: without a calibration there is no motion: give --calib FILE", kind));
    }
    if (!job.options.temporal) {
      throw InvalidArgument(
          fmt::format("--write {}: temporal=false predicts nothing that could move: leave it out", kind));
    }
  }
  if (job.kinds.contains("overview")) {
    for (const vision::StereoFrame& frame : sequence.frames) vision::expect_truth_of_size(frame, job.source->size());
  }
  if (!arguments.has_sink()) return;
  const std::string what = arguments.has_recording() ? "--out " + arguments.out
                           : arguments.rerun         ? "--rerun"
                                                     : "--show";
  const bool shows_depth = arguments.has_recording() || arguments.rerun;
  if (shows_depth && !sequence.has_calibration) {
    throw InvalidArgument(what + ": shows depth, which needs a calibration: give --calib");
  }
  if (arguments.has_recording() && !arguments.out.ends_with(".rrd") && arguments.bag.bag.empty()) {
    throw InvalidArgument(what + ": its messages have the stamps of a bag: give a folder, or FILE.rrd");
  }
  if (!arguments.has_folder() && (!job.kinds.empty() || arguments.resume)) {
    throw InvalidArgument(what + ": --write, --interpolate and --resume are for a folder: give one as --out");
  }
}

OutputFolder folder_of(const RunArguments& arguments, const SequenceJob& job) {
  std::vector<std::string> files = output_files(job.kinds, job.source->sequence(), job.options);
  if (job.source->has_no_files() && job.source->sequence().has_calibration) files.emplace_back(kRunCalibration);
  return {arguments.out, arguments.resume, files};
}

}  // namespace

void RunArguments::add_to(CLI::App& command) {
  input.add_to(command);
  OptionGroup output(command, "Output");
  output.add("--out", out, "DIR|FILE",
             "new or empty folder to write: disparity/NNNNNN.png (KITTI's format; .pfm where that has no room for "
             "the range), poses.txt, report.json. With the Python package also FILE.rrd, for the viewer Rerun, and of "
             "a bag FILE.mcap, for ROS 2");
  output.add("--write", write, "LIST", write_list_help());
  output.add(
      "--cloud-sigma", cloud_sigma_percent, "PERCENT",
      fmt::format("--write cloud leaves out depths whose standard deviation is larger than this [% of the depth, {:g}]",
                  cloud_sigma_percent));
  output.add_flag("--interpolate", interpolate, "fill holes from the background, into OUT/interpolated");
  output.add("--trace", trace, "FILE",
             "write when every kernel, transfer and step of the host ran, as a Chrome trace (JSON) that "
             "https://ui.perfetto.dev opens");
  output.add_flag("--resume", resume,
                  "go on with a run that was stopped: its maps stay, the result is that of an undisturbed run. Frames "
                  "before are computed again, for the filter's state");
  output.add_flag("--rerun", rerun, "show each frame in the viewer Rerun, by the Python package");
  output.add_flag(
      "--show", show,
      "show the left image and the disparity of each frame on a page in the browser, by the Python package");
  output.add_flag("--quiet", quiet, "no progress, only errors");
  bag.add_to(command);
  method.add_to(command);
  add_motion(command, poses, odometry);
  command.get_option("--poses")->excludes("--pose-topic");
  add_device_option(command, "--device", device);
  add_device_option(command, "--fallback", fallback);
  add_device_option(command, "--programs", programs);
  add_device_option(command, "--cache", cache);
  add_device_option(command, "--tuning", tuning);
}

SequenceJob RunArguments::job(const Package& package) const {
  if (bag.bag.empty() && vision::is_bag(input.folder)) {
    RunArguments of_bag = *this;
    of_bag.bag.bag = std::exchange(of_bag.input.folder, "");
    return of_bag.job(package);
  }
  SequenceJob job;
  if (out.empty() && !rerun && !show) throw InvalidArgument("--out is required: see `egosgm run --help`");
  job.options = method.options();
  job.kinds = parse_write_list(write);
  if (interpolate) job.kinds.insert("interpolated");
  job.cloud.max_relative_sigma = cloud_sigma_percent / 100;
  if (!(cloud_sigma_percent > 0)) {
    throw InvalidArgument(fmt::format("--cloud-sigma {:g}: choose a number of percent above 0", cloud_sigma_percent));
  }
  if (!job.kinds.contains("cloud") && cloud_sigma_percent != RunArguments().cloud_sigma_percent) {
    throw InvalidArgument(
        fmt::format("--cloud-sigma {:g}: is of clouds: give --write cloud, too", cloud_sigma_percent));
  }
  if (const std::string option = bag.option_without_bag(); !option.empty()) {
    throw InvalidArgument(option + ": is of a bag: give --bag BAG with it");
  }
  if (package.take_over) {
    const std::optional<VideoArguments> videos = input.videos();
    const std::string why = rerun             ? "--rerun"
                            : show            ? "--show"
                            : has_recording() ? "--out " + out
                            : videos          ? videos->left
                                              : bag.bag;
    if (!why.empty()) package.take_over(why);
  }
  job.source = source_of(*this, package);
  SequenceArguments looked_at = input;
  if (job.source->has_no_files()) looked_at.frames = "";  // `doctor` takes no frames of bags and videos
  job.input = looked_at.text();
  if (!bag.bag.empty()) job.input = bag.text() + (job.input.empty() ? "" : " " + job.input);
  job.poses_file = poses;
  job.odometry = odometry;
  expect_takeable(*this, job);
  if (job.source->has_no_files() && has_folder()) job.kinds.insert("left");
  if (has_folder()) job.out = folder_of(*this, job);
  if (has_sink()) {
    job.sink = package.take(has_recording() ? out : "", rerun, show);
    job.sink_takes_all = has_recording() || rerun;
  }
  job.trace = job.out.named_file("--trace", trace);
  job.save_config = job.out.named_file("--save-config", method.save_config);
  job.quiet = quiet;
  return job;
}

}  // namespace egosgm::app
