// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "apps/frame_sink.h"
#include "apps/output_folder.h"
#include "apps/run_report.h"
#include "egosgm/device.h"
#include "egosgm/odometry.h"
#include "egosgm/options.h"
#include "egosgm/vision/point_cloud.h"

namespace egosgm::app {

/// The calibration's file in the folder of a run whose images came from no files.
inline constexpr const char* kRunCalibration = "calibration.txt";
inline constexpr const char* kRunObjects = "objects.csv";

/// A sequence, how to match it, and where its results go.
struct SequenceJob {
  std::shared_ptr<vision::FrameSource> source;
  std::shared_ptr<FrameSink> sink;  // null: the folder alone takes what the run makes
  bool sink_takes_all = true;       // false: the disparity alone
  std::string input;                // the arguments that named the sequence, for messages
  PipelineOptions options;
  std::string poses_file;          // empty: stereo odometry,
  StereoOdometryOptions odometry;  // with these options
  OutputFolder out;                // of no name: there is none
  std::set<std::string> kinds;     // what is written beside the disparity, see parse_write_list
  vision::PointCloudOptions cloud;
  // Files that are written as well, where they are not empty: the options in use, and a trace of all commands.
  std::filesystem::path save_config, trace;
  bool quiet = false;
  std::optional<LostDevice> lost;  // which this one takes over from
};

/// Every frame that is pair into `job.out`, then poses.txt and report.json, and to the sink. Returns false where an
/// interrupt ended it early. Throws InvalidArgument (input), IoError, DeviceError; report.json then says why it
/// stopped, where it could be written. Thread-safe for different folders.
bool run_sequence(const SequenceJob& job, const Device& device);

}  // namespace egosgm::app
