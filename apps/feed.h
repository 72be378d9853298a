// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/frame.h"
#include "egosgm/options.h"
#include "egosgm/vision/dataset.h"

namespace egosgm::app {

/// A frame that comes to a run.
struct FedFrame {
  vision::StereoFrame frame;
  vision::StereoImages images;
  std::string unreadable;                              // why there are no images; empty: there are
  bool starts_anew = false;                            // the camera may have come from anywhere: nothing is predicted
  std::optional<Eigen::Isometry3d> world_from_camera;  // where the sequence knows it
  std::optional<std::int64_t> stamp_ns;                // when it was taken
  std::string camera;                                  // its frame's name in ROS
};

/// Where the frames of a run come from, one after the other, and who else sees what is made of them.
class Feed {
 public:
  virtual ~Feed() = default;

  /// What is known before the first frame. `frames` may be more than come, and `numbers` are empty where that is so.
  const vision::StereoSequence& sequence() const { return sequence_; }
  cv::Size size() const { return size_; }
  PixelType type() const { return type_; }
  /// Whether the left images are in no files, so that a run writes them, too.
  virtual bool has_no_files() const { return false; }
  /// What the poses of its frames are, such as a topic; empty: its frames have none.
  virtual std::string poses() const { return {}; }
  /// The next frame; none at the end. Called by one thread at a time. Throws InvalidArgument.
  virtual std::optional<FedFrame> next() = 0;
  /// Whether left images were passed over, so that a frame's number does not count them. Known once the frames have
  /// come.
  virtual bool has_lost_images() const { return false; }
  /// What was unusual, once the frames have come.
  virtual std::vector<std::string> notes() const { return {}; }

 protected:
  vision::StereoSequence sequence_;
  cv::Size size_;
  PixelType type_ = PixelType::kU8;
};

/// The frames of files.
class FileFeed : public Feed {
 public:
  /// Throws InvalidArgument where the images are of different sizes.
  explicit FileFeed(vision::StereoSequence sequence);
  std::optional<FedFrame> next() override;

 private:
  std::size_t next_ = 0;
};

/// The maps of a frame as they come from the device: CV_32FC1, and CV_8UC1 of reasons.
struct ShownMaps {
  cv::Mat disparity, variance, reason;
};

/// Who takes a run's maps beside its folder, or in place of it.
class Taker {
 public:
  virtual ~Taker() = default;
  /// Before the first frame. Throws InvalidArgument and IoError.
  virtual void begin(const PipelineOptions& options, const Calibration& calibration) = 0;
  virtual void take(const FedFrame& frame, const ShownMaps& maps, const FrameReport& report,
                    const std::optional<Eigen::Isometry3d>& current_from_previous) = 0;
  /// All came; or, after a begin that may have thrown, the run stopped.
  virtual void end(bool finished) = 0;
};

}  // namespace egosgm::app
