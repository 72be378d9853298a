// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/matcher.h"

#include <limits>
#include <string>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "egosgm/vision/opencv.h"
#include "vision/grey_bytes.h"

namespace egosgm::vision {
namespace {

cv::Mat grey_of(const cv::Mat& image, const char* name) {
  const bool is_read = image.depth() == CV_8U || image.depth() == CV_16U;
  if (image.empty() || !is_read || (image.channels() != 1 && image.channels() != 3)) {
    throw InvalidArgument(std::string("Matcher: the ") + name + " image is " +
                          (image.empty() ? "empty" : cv::typeToString(image.type())) +
                          ": give grey or BGR of 8 or 16 bits");
  }
  if (image.channels() == 1) return image;
  return grey_of_colors(image, ColorOrder::kBgr);
}

constexpr int kAnyDifference_px = 4096;  // no range is wider

/// That the options are valid, and their disparities fit.
void expect_sixteenths(const PipelineOptions& options) {
  options.validate();
  const int end = options.min_disparity + options.disparities;
  constexpr int kLargest = std::numeric_limits<std::int16_t>::max() / cv::StereoMatcher::DISP_SCALE;
  if (end > kLargest || options.min_disparity - 1 < -kLargest) {
    throw InvalidArgument("Matcher: disparities " + std::to_string(options.min_disparity) + " to " +
                          std::to_string(end - 1) + " do not fit into 16 bits with 16 steps a pixel: up to " +
                          std::to_string(kLargest - 1) + " do; Pipeline gives float");
  }
}

}  // namespace

struct Matcher::State {
  State(const std::optional<Calibration>& of_camera, const PipelineOptions& wanted, const Device& on)
      : calibration(of_camera), options(wanted), device(on) {}

  std::optional<Calibration> calibration;
  PipelineOptions options;
  Device device;
  std::optional<Pipeline> pipeline;
  cv::Size size;
  int type = -1;

  void prepare(cv::Size wanted, int wanted_type) {
    if (pipeline && wanted == size && wanted_type == type) return;
    // Without prediction nothing depends on the camera.
    const Calibration camera = calibration.value_or(
        Calibration{.fx = 1000, .fy = 1000, .cx = wanted.width / 2.0, .cy = wanted.height / 2.0, .baseline_m = 1});
    pipeline.emplace(camera, wanted.width, wanted.height, options, device,
                     CV_MAT_DEPTH(wanted_type) == CV_8U ? PixelType::kU8 : PixelType::kU16);
    size = wanted;
    type = wanted_type;
  }

  template <typename Value>
  void change(Value PipelineOptions::*option, Value value) {
    PipelineOptions changed = options;
    changed.*option = value;
    expect_sixteenths(changed);
    options = changed;
    pipeline.reset();
  }
};

Matcher::Matcher(const Calibration& calibration, const PipelineOptions& options, const Device& device)
    : state_(std::make_unique<State>(calibration, options, device)) {
  calibration.validate();
  expect_sixteenths(options);
}

Matcher::Matcher(const PipelineOptions& options, const Device& device)
    : Matcher(Calibration{.fx = 1000, .fy = 1000, .cx = 0, .cy = 0, .baseline_m = 1}, options, device) {
  state_->calibration.reset();
  state_->options.temporal = false;
}

PipelineOptions Matcher::single_pair() {
  PipelineOptions options;
  options.paths = 8;
  return options;
}

Matcher::~Matcher() = default;
Matcher::Matcher(Matcher&&) noexcept = default;
Matcher& Matcher::operator=(Matcher&&) noexcept = default;

void Matcher::compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity) {
  compute(left, right, disparity, std::nullopt);
}

void Matcher::compute(cv::InputArray left, cv::InputArray right, cv::OutputArray disparity,
                      const std::optional<Motion>& motion) {
  const cv::Mat left_grey = grey_of(left.getMat(), "left"), right_grey = grey_of(right.getMat(), "right");
  if (left_grey.size() != right_grey.size() || left_grey.type() != right_grey.type()) {
    throw InvalidArgument("Matcher: the left image is " + std::to_string(left_grey.cols) + "x" +
                          std::to_string(left_grey.rows) + ", the right one " + std::to_string(right_grey.cols) + "x" +
                          std::to_string(right_grey.rows) + ": both need one size and depth");
  }
  state_->prepare(left_grey.size(), left_grey.type());
  cv::Mat map(left_grey.size(), CV_32FC1);
  FrameOutputs outputs;
  outputs.disparity = map_view(map);
  state_->pipeline->process(image_view(left_grey), image_view(right_grey), motion, outputs);
  cv::Mat steps;
  map.convertTo(steps, CV_16SC1, DISP_SCALE);
  steps.setTo((getMinDisparity() - 1) * DISP_SCALE, map == kInvalidDisparity);
  steps.copyTo(disparity);
}

const PipelineOptions& Matcher::options() const { return state_->options; }

int Matcher::getMinDisparity() const { return options().min_disparity; }
void Matcher::setMinDisparity(int least) { state_->change(&PipelineOptions::min_disparity, least); }
int Matcher::getNumDisparities() const { return options().disparities; }
void Matcher::setNumDisparities(int count) { state_->change(&PipelineOptions::disparities, count); }
int Matcher::getSpeckleWindowSize() const { return options().max_speckle_px; }
void Matcher::setSpeckleWindowSize(int most_px) { state_->change(&PipelineOptions::max_speckle_px, most_px); }
int Matcher::getDisp12MaxDiff() const { return cvRound(options().left_right_px); }
void Matcher::setDisp12MaxDiff(int most_px) {
  state_->change(&PipelineOptions::left_right_px, static_cast<float>(most_px > 0 ? most_px : kAnyDifference_px));
}

int Matcher::getBlockSize() const {
  switch (options().cost) {
    case MatchingCost::kCensus9x7:
      return 9;
    case MatchingCost::kLearned7x7:
      return 7;
    case MatchingCost::kCensus5x5:
      return 5;
    case MatchingCost::kSad3x3:
      return 3;
  }
  return 0;
}

void Matcher::setBlockSize(int side_px) {
  if (side_px == getBlockSize()) return;
  throw InvalidArgument("Matcher: blockSize " + std::to_string(side_px) +
                        ": the window belongs to the cost: choose PipelineOptions::cost");
}

int Matcher::getSpeckleRange() const { return 0; }

void Matcher::setSpeckleRange(int range) {
  if (range == getSpeckleRange()) return;
  throw InvalidArgument("Matcher: speckleRange " + std::to_string(range) +
                        ": the method has its own: leave it out, and set speckleWindowSize");
}

}  // namespace egosgm::vision
