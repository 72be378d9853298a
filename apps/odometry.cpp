// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <CLI/App.hpp>
#include <exception>
#include <filesystem>
#include <memory>

#include "apps/command.h"
#include "apps/interrupt.h"
#include "apps/option_group.h"
#include "apps/output_folder.h"
#include "apps/progress.h"
#include "apps/sequence_arguments.h"
#include "apps/standard_output.h"
#include "egosgm/error.h"
#include "egosgm/vision/poses_io.h"
#include "vision/file_io.h"
#include "vision/motion_source.h"

namespace egosgm::app {
namespace {

struct OdometryArguments {
  SequenceArguments input;
  std::string out;
  StereoOdometryOptions options;
  bool quiet = false;
};

void tell(const vision::StereoFrame& frame, const vision::FrameMotion& motion, bool first, Progress& progress) {
  const OdometryResult& odometry = motion.odometry;
  if (!first && !odometry.motion)
    progress.note(fmt::format("frame {}: no motion ({}): the last one is repeated", frame.name, odometry.reason));
  const double travel_m = odometry.motion ? odometry.motion->current_from_previous.translation().norm() : 0;
  progress.done(fmt::format("frame {}  {:5d} inliers  {:6.3f} m  {:.0f} ms", frame.name, odometry.inliers, travel_m,
                            motion.odometry_ms));
}

int estimate(const OdometryArguments& arguments, const CalibrationReader& read) {
  vision::FileSource source(arguments.input.open(/*needs_calibration=*/true, read));
  const vision::StereoSequence& sequence = source.sequence();
  vision::MotionSource motions(sequence, {}, arguments.options);
  expect_no_folder("--out", arguments.out);
  vision::make_folder(std::filesystem::absolute(arguments.out).parent_path());
  expect_new_file("--out", arguments.out);
  std::vector<Isometry> poses;
  std::exception_ptr failure;
  catch_interrupts();
  try {
    // Poses on the standard output stay alone.
    Progress progress(static_cast<int>(sequence.frames.size()), arguments.quiet || vision::is_stream(arguments.out));
    if (!sequence.note.empty()) progress.note(sequence.note);
    while (!interrupted()) {
      const std::optional<vision::VideoPair> pair = source.next();
      if (!pair) break;
      if (!pair->unreadable.empty()) throw InvalidArgument(pair->unreadable);
      const vision::FrameMotion motion = motions.next(*pair, poses.size());
      tell(pair->frame, motion, poses.empty(), progress);
      poses.push_back(motion.first_from_camera);
    }
  } catch (const std::exception&) {  // the poses before are whole
    failure = std::current_exception();
  }
  const vision::KeepFiles others;
  if (!poses.empty()) vision::write_poses(arguments.out, poses);
  if (failure) std::rethrow_exception(failure);
  if (poses.size() == sequence.frames.size()) return kOk;
  say(fmt::format("egosgm: interrupted after {} of {} frames", poses.size(), sequence.frames.size()));
  return kInterrupted;
}

}  // namespace

Command add_odometry(CLI::App& program, const Package& package) {
  CLI::App* command = program.add_subcommand("odometry", "Estimate the camera's poses alone, without matching");
  auto arguments = std::make_shared<OdometryArguments>();
  OptionGroup options(*command);
  arguments->input.add_to(*command);
  options.add("--out", arguments->out, "FILE", "new file: KITTI poses, camera-to-world, relative to the first frame")
      ->required();
  add_motion_bounds(*command, arguments->options, "Options");
  options.add_flag("--quiet", arguments->quiet, "no progress, only errors");
  return {command, [arguments, read = package.read_calibration] { return estimate(*arguments, read); }};
}

}  // namespace egosgm::app
