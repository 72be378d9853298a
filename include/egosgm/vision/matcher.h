// SPDX-License-Identifier: Apache-2.0
// The pipeline as OpenCV's matchers are called, for those who have OpenCV: egosgm::vision itself does not need it.
#pragma once

#include <memory>
#include <opencv2/calib3d.hpp>
#include <optional>

#include "egosgm/calibration.h"
#include "egosgm/device.h"
#include "egosgm/motion.h"
#include "egosgm/options.h"

namespace egosgm::vision {

/// A cv::StereoMatcher, in the place of a cv::StereoSGBM. Sizes may change between calls; each new one builds its
/// pipeline, and so does each setter. A pair alone depends on no pair before: where options.vertical_alignment is true,
/// it is matched twice, first to find the vertical offset. Not thread-safe. Programs that use it link opencv_core.
class Matcher : public cv::StereoMatcher {
 public:
  /// Options that suit single pairs: the default ones, with eight paths.
  static PipelineOptions single_pair();

  /// For single frames: `options.temporal` is taken as false, and no calibration is needed. Throws InvalidArgument
  /// where an option is wrong, or disparities do not fit into 16 bits with 4 of a pixel's part.
  explicit Matcher(const PipelineOptions& options = single_pair(), const Device& device = Device::select());
  /// For video, with the motion of each frame.
  Matcher(const Calibration& calibration, const PipelineOptions& options, const Device& device = Device::select());
  ~Matcher() override;
  Matcher(Matcher&&) noexcept;
  Matcher& operator=(Matcher&&) noexcept;

  /// A rectified pair, grey or BGR, of 8 or 16 bits. `disparity` becomes CV_16SC1: 16 times the disparity, rounded;
  /// (min_disparity - 1) * 16 where there is none, as OpenCV has it. Throws InvalidArgument for other images.
  void compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity) override;
  /// Computes the map of the next frame of a video.
  void compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity,
               const std::optional<Motion>& motion);

  const PipelineOptions& options() const;

  // The options by OpenCV's names. Setters throw InvalidArgument as the constructor does, and then change nothing.
  int getMinDisparity() const override;
  void setMinDisparity(int least) override;
  int getNumDisparities() const override;
  void setNumDisparities(int count) override;  ///< Any number, not only multiples of 16.
  int getSpeckleWindowSize() const override;
  void setSpeckleWindowSize(int most_px) override;
  int getDisp12MaxDiff() const override;
  void setDisp12MaxDiff(int most_px) override;  ///< 0 or less: any difference.
  /// The size of the window that belongs to options().cost. Setting another one is refused: choose the cost.
  int getBlockSize() const override;
  void setBlockSize(int side_px) override;
  /// 0: the method has its own. Setting another one is refused.
  int getSpeckleRange() const override;
  void setSpeckleRange(int range) override;

 private:
  struct State;

  static Calibration any_camera(double cx, double cy);
  static cv::Mat grey_of(const cv::Mat& image, const char* name);
  static void expect_sixteenths(const PipelineOptions& options);
  void prepare(cv::Size size, int type);
  template <typename Value>
  void change(Value PipelineOptions::*option, Value value);

  std::unique_ptr<State> state_;
};

}  // namespace egosgm::vision

#include "egosgm/vision/matcher_inline.h"
