// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "apps/cli_names.h"
#include "apps/command.h"
#include "apps/option_arguments.h"
#include "apps/run_sequence.h"
#include "apps/sequence_arguments.h"
#include "egosgm/odometry.h"
#include "egosgm/vision/point_cloud.h"

namespace egosgm::app {

/// The arguments of `egosgm run`.
struct RunArguments {
  SequenceArguments input;
  BagArguments bag;
  OptionArguments method;
  std::string out, poses, device, fallback, programs, cache, tuning, write, trace;
  StereoOdometryOptions odometry;
  double cloud_sigma_percent = 100 * vision::PointCloudOptions().max_relative_sigma;
  bool interpolate = false, quiet = false, resume = false, rerun = false, show = false;

  void add_to(CLI::App& command);

  /// Whether --out is one file for all frames, which the package writes.
  bool has_recording() const { return out.ends_with(".mcap") || out.ends_with(".rrd"); }
  bool has_folder() const { return !out.empty() && !has_recording(); }
  bool has_sink() const { return has_recording() || rerun || show; }

  /// Opens the input and the outputs. Throws InvalidArgument for what does not go together.
  SequenceJob job(const Package& package) const;
};

}  // namespace egosgm::app
