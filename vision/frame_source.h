// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/frame.h"
#include "egosgm/vision/dataset.h"

namespace egosgm::vision {

/// A pair of images that comes from a source.
struct VideoPair {
  StereoFrame frame;
  StereoImages images;
  std::string unreadable;                              // why there are no images; empty: there are
  bool starts_anew = false;                            // the camera may have come from anywhere: nothing is predicted
  std::optional<Eigen::Isometry3d> world_from_camera;  // where the sequence knows it
  std::optional<std::int64_t> stamp_ns;                // when it was taken
  std::string camera;                                  // its frame's name in ROS
};

/// The pairs of a video, one after the other.
class EGOSGM_EXPORT FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// What is known before the first pair. `frames` may be more than come, and `numbers` are empty where that is so.
  const StereoSequence& sequence() const { return sequence_; }
  Size size() const { return size_; }
  PixelType type() const { return type_; }
  /// Whether the left images are in no files, so that a run writes them, too.
  virtual bool has_no_files() const { return false; }
  /// The source of its frames' poses, such as a topic; empty: its frames have none.
  virtual std::string poses() const { return {}; }
  /// The next pair; none at the end. Called by one thread at a time. Throws InvalidArgument.
  virtual std::optional<VideoPair> next() = 0;
  /// Whether left images were passed over, so that a frame's number does not count them. Known once the pairs have
  /// come.
  virtual bool has_lost_images() const { return false; }
  /// What was unusual, once the pairs have come.
  virtual std::vector<std::string> notes() const { return {}; }

 protected:
  StereoSequence sequence_;
  Size size_;
  PixelType type_ = PixelType::kU8;
};

/// The pairs of files.
class EGOSGM_EXPORT FileSource : public FrameSource {
 public:
  /// Throws InvalidArgument where the images are of different sizes, or where no pair can be read.
  explicit FileSource(StereoSequence sequence);
  std::optional<VideoPair> next() override;

 private:
  std::size_t next_ = 0;
};

}  // namespace egosgm::vision
