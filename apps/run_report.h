// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/run_outputs.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/dataset.h"
#include "vision/stereo_video.h"

namespace egosgm::app {

/// Host times of a frame beside those of the pipeline.
struct HostTimes {
  double read_ms = 0, write_ms = 0;
  double wall_ms = 0;  // from frame to frame
};

/// A device that failed in a run, and how.
struct LostDevice {
  DeviceInfo device;
  std::string why;
};

/// The device as reports name it.
nlohmann::ordered_json json_of(const DeviceInfo& info);

/// OUT/report.json: what ran, on what, and what every frame gave.
class RunReport {
 public:
  /// `motion`: where the motions come from.
  RunReport(const vision::StereoSequence& sequence, const Pipeline& pipeline, const std::string& motion, int width,
            int height);

  /// All that the maps depend on. Two runs with equal identities give the same maps.
  nlohmann::ordered_json identity() const;

  void add(const vision::VideoFrame& made, const HostTimes& times, const WrittenFrame& written);

  /// Names the numbers of `run --write reason`.
  void add_reasons();

  /// The device goes on with what another one began: the identity is without it.
  void take_over(const LostDevice& from);

  /// A pair that could not be read.
  void leave_out(const vision::StereoFrame& frame, const std::string& why);
  /// Records what speaks against the input (see InputCheck), and unusual things about its frames.
  void set_warning(const std::string& warning, const std::vector<std::string>& notes);

  /// `finished`: whether all frames ran; else `why_not` says what stopped them. Throws IoError.
  void write(const std::filesystem::path& file, bool finished, const std::string& why_not = {});

  /// The mean of a figure over the frames. A frame that matched the range more than once counts as 1.
  double mean(const char* figure) const;

 private:
  nlohmann::ordered_json json_;
};

/// A motion as JSON: translation [m], rotation angle [deg], and the 3x4 matrix current_from_previous, row-major.
nlohmann::ordered_json json_of(const Eigen::Isometry3d& current_from_previous);

}  // namespace egosgm::app
