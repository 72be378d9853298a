// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/frame_sink.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/moving_objects.h"
#include "egosgm/vision/point_cloud.h"
#include "host/frame_outputs.h"
#include "vision/frame_panels.h"

namespace egosgm::app {

/// Parses the outputs that `egosgm run` writes beside OUT/disparity, a folder each, a file a frame.
std::set<std::string> parse_write_list(const std::string& list);
/// A file of a frame, relative to OUT, and those of all frames. Disparities are KITTI's PNG, or PFM where that has no
/// room for the searched range.
std::string output_file(const std::string& kind, const std::string& frame, const PipelineOptions& options);
std::vector<std::string> output_files(const std::set<std::string>& kinds, const vision::StereoSequence& sequence,
                                      const PipelineOptions& options);
/// The names that parse_write_list takes, as --help describes them.
std::string write_list_help();

/// Counts of a frame's points, and of those that its cloud left out.
struct CloudCounts {
  std::int64_t points = 0;
  vision::LeftOut left_out;
};

struct WrittenFrame {
  std::int64_t unstorable = 0;       // disparities that KITTI's PNG has no room for
  std::int64_t too_far = 0;          // depths that the PNG of depths has no room for, and no other file holds
  std::optional<CloudCounts> cloud;  // where one was written
};

/// The maps of one frame and the files that they go to. Every file appears whole or not at all.
class RunOutputs {
 public:
  /// Makes the folders, unless `folder` has no name. Throws IoError.
  RunOutputs(std::filesystem::path folder, std::set<std::string> kinds, vision::Size size,
             const PipelineOptions& options, const Calibration& calibration, const vision::PointCloudOptions& cloud);

  /// The views that the pipeline writes to; valid as long as this object lives.
  const FrameOutputs& views() const { return outputs_; }

  /// Makes these, too, whatever is written.
  void make_maps(const Wanted& wanted);
  ShownMaps shown() const {
    return {map(Output::kDisparity), map(Output::kVariance), map(Output::kReason), found_ ? &*found_ : nullptr};
  }

  /// Writes the frame that the views hold, and the scene flow from the one before; `left` is its left image, `motion`
  /// the camera's from the frame before.
  WrittenFrame write(const vision::StereoFrame& frame, const vision::Image& left, const std::optional<Motion>& motion);

  /// The rows of objects.csv so far, where objects are written.
  std::optional<std::string> objects() const { return wants("objects") ? std::optional(objects_) : std::nullopt; }

 private:
  bool wants(const char* kind) const { return kinds_.contains(kind); }
  void write_scene_flow(const vision::StereoFrame& frame, const vision::Image& left,
                        const std::optional<Motion>& motion);
  const vision::Image& map(Output output) const { return maps_[static_cast<std::size_t>(output)]; }

  const std::filesystem::path folder_;
  const vision::Size size_;
  const std::set<std::string> kinds_;
  const PipelineOptions options_;
  const Calibration calibration_;
  const vision::PointCloudOptions cloud_;
  std::array<vision::Image, kOutputCount> maps_;  // empty where it is not wanted
  FrameOutputs outputs_;                          // views of them
  vision::FramePanels panels_;
  std::optional<vision::ObjectTracker> tracker_;  // where scene flow is written
  std::optional<vision::LabelledObjects> found_;  // in the newest frame
  std::string last_frame_, objects_;
};

}  // namespace egosgm::app
