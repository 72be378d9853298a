// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "egosgm/vision/dataset.h"

namespace egosgm::app {

/// When the frames were taken, one time each, and the file that says so; empty where none does.
struct FrameTimes {
  std::filesystem::path file;
  std::vector<double> seconds;
};

/// Reads the sequence's times_file: seconds in each row (KITTI odometry) or a date and a time (KITTI raw), for the
/// frames that vision::rows_of_frames tells. Throws InvalidArgument, naming file and row.
FrameTimes frame_times(const vision::StereoSequence& sequence);

}  // namespace egosgm::app
