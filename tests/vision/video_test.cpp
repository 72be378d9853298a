// SPDX-License-Identifier: Apache-2.0
// What a frame knows from the ones before it must cost little of what a single frame sees: thin things, and what moves.
#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "egosgm/pipeline.h"
#include "egosgm/vision/opencv.h"
#include "host/method_options.h"
#include "tests/vision/rendered_video.h"

namespace egosgm::vision {
namespace {

/// From this frame on, a video has settled.
constexpr int kSteadyFrom = 3;

/// Percent of the pixels in `masks`, of the steady frames, that are off by more than 3 px or have no disparity.
double bad_or_missing(const RenderedVideo& video, const std::vector<cv::Mat>& masks, bool temporal) {
  MethodOptions options;
  options.temporal = temporal;
  const Size size = video.frames.front().left.size();
  Pipeline pipeline(video.sequence.calibration(), size.width, size.height, options);
  Image disparity(size, kF32);
  FrameOutputs outputs;
  outputs.disparity = map_view(disparity);
  double bad = 0, all = 0;
  for (int k = 0; k < static_cast<int>(video.frames.size()); ++k) {
    const SyntheticFrame& frame = video.frames[k];
    const std::optional<Motion> motion = k > 0 ? std::optional(video.sequence.motion(k)) : std::nullopt;
    pipeline.process(image_view(frame.left), image_view(frame.right), motion, outputs);
    if (k < kSteadyFrom) continue;
    const cv::Mat error =
        cv::abs(mat_of(disparity) - mat_of(frame.left_disparity));  // huge where there is no disparity
    bad += cv::countNonZero((error > 3) & masks[k] & mat_of(frame.left_noc));
    all += cv::countNonZero(masks[k] & mat_of(frame.left_noc));
  }
  EXPECT_GT(all, 500) << "pixels";
  return 100 * bad / all;
}

std::vector<cv::Mat> masks_of(const RenderedVideo& video,
                              const std::function<cv::Mat(const SyntheticFrame&)>& mask_of) {
  std::vector<cv::Mat> masks;
  for (const SyntheticFrame& frame : video.frames) masks.push_back(mask_of(frame));
  return masks;
}

/// What is narrower than seven pixels and stands out from both sides.
cv::Mat thin_things(const SyntheticFrame& frame) {
  cv::Mat wider;
  cv::morphologyEx(mat_of(frame.left_disparity), wider, cv::MORPH_OPEN, cv::Mat::ones(1, 7, CV_8U));
  return mat_of(frame.left_disparity) - wider > 3;
}

// A single frame of the same matcher, which searches everything in both views, loses fewer of them.
TEST(Video, ThinThingsSurvive) {
  const std::pair<double, double> most_lost[] = {{2, 62}, {3, 40}, {4, 20}};  // [px], percent
  for (const auto& [width, most] : most_lost) {
    const RenderedVideo video({.frames = 8, .pole_width_px = width, .pole_spacing_m = 3, .supersampling = 2});
    const std::vector<cv::Mat> poles = masks_of(video, thin_things);
    EXPECT_LE(bad_or_missing(video, poles, true), most) << "poles of " << width;
  }
}

TEST(Video, VehiclesThatMoveAreFollowed) {
  for (const unsigned seed : {1u, 2u}) {
    const RenderedVideo video({.frames = 10, .seed = seed, .moving_object = true, .supersampling = 2});
    const std::vector<cv::Mat> vehicles =
        masks_of(video, [](const SyntheticFrame& frame) { return mat_of(frame.left_moving).clone(); });
    EXPECT_LE(bad_or_missing(video, vehicles, true), bad_or_missing(video, vehicles, false) + 1) << "seed " << seed;
  }
}

}  // namespace
}  // namespace egosgm::vision
