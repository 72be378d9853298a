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

/// Reads times.txt or timestamps.txt from the folder of the left images or the two above it: seconds in each row
/// (KITTI odometry) or a date and a time (KITTI raw). A row for each frame, or rows from frame 0 on. Throws
/// InvalidArgument, naming file and row.
FrameTimes frame_times(const vision::StereoSequence& sequence);

}  // namespace egosgm::app
