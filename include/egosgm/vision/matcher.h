// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "egosgm/calibration.h"
#include "egosgm/device.h"
#include "egosgm/export.h"
#include "egosgm/motion.h"
#include "egosgm/options.h"

namespace egosgm::vision {

/// What is called as cv::StereoMatcher is, for code that has a cv::StereoSGBM today. Sizes may change between calls;
/// each new one builds its pipeline. A pair alone depends on no pair before: where options.vertical_alignment is true,
/// it is matched twice, first to find the vertical offset. Not thread-safe.
class EGOSGM_EXPORT Matcher {
 public:
  /// Least value of 16-bit disparities: four bits of a pixel's part.
  static constexpr int kDispShift = 4, kDispScale = 1 << kDispShift;

  /// For single frames: `options.temporal` is taken as false, and no calibration is needed. Throws InvalidArgument
  /// where an option is wrong, or disparities do not fit into 16 bits with 4 of a pixel's part.
  explicit Matcher(const PipelineOptions& options = {}, const Device& device = Device::select());
  /// For video, with the motion of each frame.
  Matcher(const Calibration& calibration, const PipelineOptions& options, const Device& device = Device::select());
  ~Matcher();
  Matcher(Matcher&&) noexcept;
  Matcher& operator=(Matcher&&) noexcept;

  /// A rectified pair, grey or BGR, of 8 or 16 bits. `disparity` becomes CV_16SC1: 16 times the disparity, rounded;
  /// (min_disparity - 1) * 16 where there is none, as OpenCV has it. Throws InvalidArgument for other images.
  void compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity);
  /// The same of the next frame of a video.
  void compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity,
               const std::optional<Motion>& motion);

  int min_disparity() const;
  int num_disparities() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace egosgm::vision
