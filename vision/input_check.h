// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "egosgm/calibration.h"
#include "egosgm/export.h"
#include "egosgm/frame.h"
#include "egosgm/options.h"
#include "egosgm/vision/image.h"
#include "vision/coarse_map.h"

namespace egosgm::vision {

/// An objection to a value, and the remedy.
struct Suspicion {
  std::string what, remedy;
  bool is_certain = true;  // else it may be right, but seldom is
};

/// A baseline of no rig that carries two cameras, or of few: the unit was mistaken, or a factor is missing. `fx`: 0
/// where it is not known. Thread-safe.
EGOSGM_EXPORT std::optional<Suspicion> suspect_baseline(double baseline_m, double fx = 0);

/// Suspects a calibration, also for a focal length or a principal point that does not fit images of `size`, where that
/// is known. Thread-safe.
EGOSGM_EXPORT std::optional<Suspicion> suspect_calibration(const Calibration& calibration, Size size);

/// Checks a run's input once it is matched: a mean density below a half (maps of good input keep four
/// fifths and more), no motion in most frames that have one before them, mosaics, images of 16 bits that hold 8 or
/// whose bytes are exchanged, rows that are farther apart than the vertical alignment corrects, a camera that stands
/// still while the other one does not, images of one value, one camera's images on both sides, what is nearer or
/// farther than the range, a suspected calibration.
class EGOSGM_EXPORT InputCheck {
 public:
  /// `calibration`: none where the images came without one, so that there is no motion either.
  InputCheck(const std::optional<Calibration>& calibration, const PipelineOptions& options)
      : calibration_(calibration), least_(options.min_disparity), end_(least_ + options.disparities) {}

  /// The next frame's images, both kU8 or both kU16, what the pipeline said of it, and whether it had a motion.
  void add(const Image& left, const Image& right, const FrameReport& report, bool has_motion);

  /// "density 24 % in the mean, no motion in 10 of 11 frames"; empty where nothing does.
  std::string text() const;

 private:
  const std::optional<Calibration> calibration_;
  const int least_, end_;
  Size size_;
  double density_ = 0;          // of all frames, added up
  std::uint64_t seen_[2] = {};  // of the last images, left and right
  std::size_t frozen_[2] =
      {};                      // frames in which one camera's image is that of the frame before, and the other's is not
  std::size_t plain_[2] = {};  // frames in which a camera's image is of one value
  std::size_t frames_ = 0, without_motion_ = 0, narrow_ = 0, far_rows_ = 0, same_ = 0;
  std::size_t looks_ = 0, mosaics_ = 0, swapped_ = 0;
  Clipped nearer_{}, farther_{};  // of the pairs of which the range clips most at either end
};

}  // namespace egosgm::vision
