// SPDX-License-Identifier: Apache-2.0
// The definitions of matcher.h, which includes it: they are compiled where OpenCV is.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/matcher.h"
#include "egosgm/vision/opencv.h"

namespace egosgm::vision {

struct Matcher::State {
  State(const std::optional<Calibration>& of_camera, const PipelineOptions& wanted, const Device& on)
      : calibration(of_camera), options(wanted), device(on) {}

  std::optional<Calibration> calibration;
  PipelineOptions options;
  Device device;
  std::optional<Pipeline> pipeline;
  cv::Size size;
  int type = -1;
};

inline Calibration Matcher::any_camera(double cx, double cy) {
  Calibration camera;
  camera.fx = camera.fy = 1000;
  camera.cx = cx, camera.cy = cy;
  camera.baseline_m = 1;
  return camera;
}

inline cv::Mat Matcher::grey_of(const cv::Mat& image, const char* name) {
  const bool is_read = image.depth() == CV_8U || image.depth() == CV_16U;
  if (image.empty() || !is_read || (image.channels() != 1 && image.channels() != 3)) {
    throw InvalidArgument(std::string("Matcher: the ") + name + " image is " +
                          (image.empty() ? "empty" : cv::typeToString(image.type())) +
                          ": give grey or BGR of 8 or 16 bits");
  }
  if (image.channels() == 1) return image;
  return mat_of(grey_of_colors(image_of(image), ColorOrder::kBgr)).clone();
}

/// That the options are valid, and their disparities fit.
inline void Matcher::expect_sixteenths(const PipelineOptions& options) {
  options.validate();
  const int end = options.min_disparity + options.disparities;
  constexpr int kLargest = std::numeric_limits<std::int16_t>::max() / cv::StereoMatcher::DISP_SCALE;
  if (end > kLargest || options.min_disparity - 1 < -kLargest) {
    throw InvalidArgument("Matcher: disparities " + std::to_string(options.min_disparity) + " to " +
                          std::to_string(end - 1) +
                          " do not fit into 16 bits with 16 steps a pixel: " + std::to_string(1 - kLargest) + " to " +
                          std::to_string(kLargest - 1) + " do; Pipeline gives float");
  }
}

inline void Matcher::prepare(cv::Size size, int type) {
  if (state_->pipeline && size == state_->size && type == state_->type) return;
  // Without prediction nothing depends on the camera.
  const Calibration camera = state_->calibration.value_or(any_camera(size.width / 2.0, size.height / 2.0));
  state_->pipeline.emplace(camera, size.width, size.height, state_->options, state_->device,
                           CV_MAT_DEPTH(type) == CV_8U ? PixelType::kU8 : PixelType::kU16);
  state_->size = size;
  state_->type = type;
}

template <typename Value>
void Matcher::change(Value PipelineOptions::*option, Value value) {
  PipelineOptions changed = state_->options;
  changed.*option = value;
  expect_sixteenths(changed);
  state_->options = changed;
  state_->pipeline.reset();
}

inline Matcher::Matcher(const Calibration& calibration, const PipelineOptions& options, const Device& device)
    : state_(std::make_unique<State>(calibration, options, device)) {
  calibration.validate();
  expect_sixteenths(options);
}

inline Matcher::Matcher(const PipelineOptions& options, const Device& device)
    : Matcher(any_camera(0, 0), options, device) {
  state_->calibration.reset();
  state_->options.temporal = false;
}

inline PipelineOptions Matcher::single_pair() {
  PipelineOptions options;
  options.paths = 8;
  return options;
}

inline Matcher::~Matcher() = default;
inline Matcher::Matcher(Matcher&&) noexcept = default;
inline Matcher& Matcher::operator=(Matcher&&) noexcept = default;

inline void Matcher::compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity) {
  compute(left, right, disparity, std::nullopt);
}

inline void Matcher::compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity,
                             const std::optional<Motion>& motion) {
  const cv::Mat left_grey = grey_of(left.getMat(), "left"), right_grey = grey_of(right.getMat(), "right");
  if (left_grey.size() != right_grey.size() || left_grey.type() != right_grey.type()) {
    const auto text_of = [](const cv::Mat& image) {
      return std::to_string(image.cols) + "x" + std::to_string(image.rows) + " of " + cv::typeToString(image.type());
    };
    throw InvalidArgument("Matcher: the left image is " + text_of(left_grey) + ", the right one " +
                          text_of(right_grey) + ": both need one size and depth");
  }
  prepare(left_grey.size(), left_grey.type());
  cv::Mat map(left_grey.size(), CV_32FC1);
  FrameOutputs outputs;
  outputs.disparity = map_view(map);
  state_->pipeline->process(image_view(left_grey), image_view(right_grey), motion, outputs);
  cv::Mat steps;
  map.convertTo(steps, CV_16SC1, DISP_SCALE);
  steps.setTo((getMinDisparity() - 1) * DISP_SCALE, map == kInvalidDisparity);
  steps.copyTo(disparity);
}

inline const PipelineOptions& Matcher::options() const { return state_->options; }

inline int Matcher::getMinDisparity() const { return options().min_disparity; }
inline void Matcher::setMinDisparity(int least) { change(&PipelineOptions::min_disparity, least); }
inline int Matcher::getNumDisparities() const { return options().disparities; }
inline void Matcher::setNumDisparities(int count) { change(&PipelineOptions::disparities, count); }
inline int Matcher::getSpeckleWindowSize() const { return options().max_speckle_px; }
inline void Matcher::setSpeckleWindowSize(int most_px) { change(&PipelineOptions::max_speckle_px, most_px); }
inline int Matcher::getDisp12MaxDiff() const { return cvRound(options().left_right_px); }
inline void Matcher::setDisp12MaxDiff(int most_px) {
  constexpr int kAnyDifference_px = 4096;  // no range is wider
  change(&PipelineOptions::left_right_px, static_cast<float>(most_px > 0 ? most_px : kAnyDifference_px));
}

inline int Matcher::getBlockSize() const {
  switch (options().cost) {
    case MatchingCost::kCensus9x7:
      return 9;
    case MatchingCost::kCensus5x5:
      return 5;
    case MatchingCost::kSad3x3:
      return 3;
  }
  return 0;
}

inline void Matcher::setBlockSize(int side_px) {
  if (side_px == getBlockSize()) return;
  throw InvalidArgument("Matcher: blockSize " + std::to_string(side_px) +
                        ": the window belongs to the cost: choose PipelineOptions::cost");
}

inline int Matcher::getSpeckleRange() const { return 0; }

inline void Matcher::setSpeckleRange(int range) {
  if (range == getSpeckleRange()) return;
  throw InvalidArgument("Matcher: speckleRange " + std::to_string(range) +
                        ": the method has its own: leave it out, and set speckleWindowSize");
}

}  // namespace egosgm::vision
