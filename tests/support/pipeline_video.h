// SPDX-License-Identifier: Apache-2.0
// Settings of a pipeline, the frames of their scene, and what a pipeline makes of them.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "egosgm/pipeline.h"
#include "host/method_options.h"
#include "host/stages/forward_warp.h"
#include "tests/reference/pipeline.h"
#include "tests/support/frame_memory.h"
#include "tests/support/scene.h"

namespace egosgm::testing {

struct Setting {
  std::string name;
  shared::ImageSize size;
  MethodOptions options;
  PixelType type = PixelType::kU8;
  Layout layout = {};
  double doffs_px = 0;
  double vertical_offset_px = 0.4;

  Scene scene() const { return Scene(size, doffs_px, vertical_offset_px); }
  friend void PrintTo(const Setting& setting, std::ostream* to) { *to << setting.name; }
};

// Few speckles are dropped and few pixels a region has, so that small images keep something.
inline MethodOptions options(int disparities, int min_disparity,
                             const std::function<void(MethodOptions&)>& change = {}) {
  MethodOptions options;
  options.disparities = disparities;
  options.min_disparity = min_disparity;
  options.speckle_removal.max_size_px = 12;
  if (change) change(options);
  return options;
}

constexpr shared::ImageSize kSize{127, 61};

inline Setting standard() { return {"standard", kSize, options(32, 0)}; }

inline std::vector<Setting> settings() {
  std::vector<Setting> all{standard()};
  all.push_back({"negative_min_16bit_odd_stride", kSize, options(32, -10), PixelType::kU16, {.padding = 3}, 12.25});
  all.push_back({"bottom_up", kSize, options(37, -1), PixelType::kU8, {.padding = 5, .bottom_up = true}, 0, -0.8});
  MethodOptions paper = PipelineOptions::paper();
  paper.disparities = 32;
  all.push_back({"paper", kSize, paper});
  all.push_back({"census5x5_four_paths_sad_check", kSize, options(24, 0, [](MethodOptions& o) {
                   o.banded_sgm.cost = MatchingCost::kCensus5x5;
                   o.banded_sgm.paths = 4;
                   o.sad_check.max_difference = 9;
                 })});
  all.push_back({"sad3x3_sad_check_16bit", kSize,
                 options(24, 0,
                         [](MethodOptions& o) {
                           o.banded_sgm.cost = MatchingCost::kSad3x3;
                           o.sad_check.max_difference = 6;
                         }),
                 PixelType::kU16});
  all.push_back({"sparse", kSize, options(24, 0, [](MethodOptions& o) {
                   o.kalman_update.keep_predicted = false;
                   o.kalman_update.gate_px = 0.25f;
                   o.kalman_update.min_variance_px2 = 0.3f;
                   o.output_variance.enabled = false;
                   o.consistency = {.measurement_px = 0.75f, .update_px = 1, .checks_prediction = true};
                   o.edge_rejection.max_jump_px = 1;
                   o.hole_fill.max_difference_px = 0.25f;
                   o.search_band.neighbour_min_count = 30;
                   o.search_band.neighbour_margin_px = 1;
                   o.speckle_removal.max_size_px = 0;
                   o.median_filter.enabled = false;
                   o.forward_warp = {.process_noise_px2 = 0.4f, .motion_noise = 2.5f};
                   o.vertical_alignment.gain = 1;
                   o.banded_sgm.p2_at_edges = 25;
                   o.banded_sgm.p2_slope = 9;
                 })});
  const auto track_left = [](MethodOptions& o) { o.track_right = false; };
  all.push_back({"left_tracked", kSize, options(32, -10, track_left), PixelType::kU16, {}, 12.25});
  all.push_back({"left_tracked_7x5", {7, 5}, options(16, 0, track_left)});
  all.push_back({"along_paths_full_search", kSize, options(24, 0, [](MethodOptions& o) {
                   o.search = SearchMode::kFull;
                   o.banded_sgm.scheduling = Scheduling::kPaths;
                   o.consistency.read_off_px = 3;
                 })});
  all.push_back({"full_search", kSize, options(24, 0, [](MethodOptions& o) { o.search = SearchMode::kFull; })});
  all.push_back({"not_temporal", kSize, options(24, 0, [](MethodOptions& o) { o.temporal = false; })});
  all.push_back({"not_aligned_sharp_jumps", kSize, options(24, 0, [](MethodOptions& o) {
                   o.track_right = true;
                   o.vertical_alignment.enabled = false;
                   o.banded_sgm.p1 = 3;
                   o.banded_sgm.p2 = 190;
                   o.banded_sgm.s_max = 30;
                   o.search_band.sigmas = 3.5f;
                   o.search_band.min_half_width_px = 0;
                   o.speckle_removal.max_difference_px = 0.5f;
                 })});
  all.push_back({"many_disparities", {45, 19}, options(1024, 0)});
  all.push_back({"many_negative_disparities", {45, 19}, options(1024, -1000), PixelType::kU8, {}, 400});
  for (const shared::ImageSize size : {shared::ImageSize{1, 1}, {7, 5}, {65, 3}}) {
    for (const int disparities : {1, 16, 37}) {
      const int min = disparities == 37 ? -7 : disparities == 1 ? 6 : 0;
      all.push_back(
          {std::to_string(size.width) + "x" + std::to_string(size.height) + "_D" + std::to_string(disparities), size,
           options(disparities, min, [](MethodOptions& o) { o.speckle_removal.max_size_px = 2; }),
           disparities == 16 ? PixelType::kU16 : PixelType::kU8});
    }
  }
  return all;
}

inline std::string setting_name(const ::testing::TestParamInfo<Setting>& info) { return info.param.name; }

/// A covariance with all that the form in forward_warp.cpp takes.
inline Motion with_covariance(Motion motion) {
  Eigen::Matrix<double, 6, 6> factor = Eigen::Matrix<double, 6, 6>::Identity() * 0.003;
  factor(2, 3) = factor(2, 4) = 0.001;
  factor(4, 3) = -0.002;
  motion.covariance = factor * factor.transpose();
  return motion;
}

/// The frames of a setting's scene.
class Video {
 public:
  explicit Video(const Setting& setting, int frames = 3) : setting_(setting), scene_(setting.scene()) {
    for (int index = 0; index < frames; ++index) pairs_.push_back(scene_.frame(index));
  }

  const Calibration& calibration() const { return scene_.calibration(); }
  const ScenePair& pair(int index) const { return pairs_[index]; }
  int size() const { return static_cast<int>(pairs_.size()); }

  ImageMemory image(int index, int view) const {
    return {setting_.size, pairs_[index].greys, view, setting_.type, setting_.layout};
  }
  Motion motion(int index) const {
    return index % 2 == 0 ? with_covariance(scene_.motion(index)) : scene_.motion(index);
  }
  reference::Images reference_images(int index) const {
    reference::Images images{pairs_[index].greys, setting_.type == PixelType::kU8 ? 8 : 16};
    if (images.bits == 8) {
      for (int& grey : images.greys) grey >>= 8;
    }
    return images;
  }
  reference::ViewMotions reference_motions(int index) const { return reference_motions(motion(index)); }
  reference::ViewMotions reference_motions(Motion scaled) const {
    scaled.covariance *= static_cast<double>(setting_.options.forward_warp.motion_noise);
    Motion back;
    back.current_from_previous = scaled.current_from_previous.inverse();
    return {disparity_motion(calibration(), scaled, EGOSGM_LEFT), disparity_motion(calibration(), scaled, EGOSGM_RIGHT),
            disparity_motion(calibration(), back, EGOSGM_LEFT),
            scaled.current_from_previous.isApprox(Eigen::Isometry3d::Identity())};
  }

 private:
  Setting setting_;
  Scene scene_;
  std::vector<ScenePair> pairs_;
};

inline Pipeline make_pipeline(const Setting& setting) {
  return Pipeline(setting.scene().calibration(), setting.size.width, setting.size.height, setting.options);
}

/// What a frame gave.
struct Result {
  FrameReport report;
  OutputMemory outputs;
};

inline Result process(Pipeline& pipeline, const Setting& setting, const Video& video, int index,
                      const std::optional<Motion>& motion) {
  Result result{{}, OutputMemory(setting.size, {setting.layout.padding, setting.layout.bottom_up})};
  const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
  result.report = pipeline.process(left.view(), right.view(), motion, result.outputs.views());
  return result;
}

inline Result process(Pipeline& pipeline, const Setting& setting, const Video& video, int index) {
  return process(pipeline, setting, video, index, video.motion(index));
}

inline std::vector<OutputMemory> process_all(Pipeline& pipeline, const Setting& setting, const Video& video) {
  std::vector<OutputMemory> outputs;
  for (int index = 0; index < video.size(); ++index) {
    outputs.push_back(process(pipeline, setting, video, index).outputs);
  }
  return outputs;
}

inline double valid_part(const std::vector<float>& disparity) {
  const auto valid = std::count_if(disparity.begin(), disparity.end(), [](float d) { return d > kInvalidDisparity; });
  return static_cast<double>(valid) / static_cast<double>(disparity.size());
}

}  // namespace egosgm::testing
