// SPDX-License-Identifier: Apache-2.0
// Whole frames: every stage against its twin, the same bits whatever the circumstances, and what a frame reports.
#include "egosgm/pipeline.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <ostream>
#include <thread>

#include "egosgm/error.h"
#include "host/dynamic_map.h"
#include "tests/reference/pipeline.h"
#include "tests/support/compare.h"
#include "tests/support/expect_refused.h"
#include "tests/support/frame_memory.h"
#include "tests/support/scene.h"
#include "tests/support/stage_chain.h"

namespace egosgm {
namespace {

using testing::expect_refused;
using testing::ImageMemory;
using testing::Layout;
using testing::OutputMemory;
using testing::Scene;
using testing::ScenePair;

struct Setting {
  std::string name;
  shared::ImageSize size;
  PipelineOptions options;
  PixelType type = PixelType::kU8;
  Layout layout = {};
  double doffs_px = 0;
  double vertical_offset_px = 0.4;

  Scene scene() const { return Scene(size, doffs_px, vertical_offset_px); }
  friend void PrintTo(const Setting& setting, std::ostream* to) { *to << setting.name; }
};

// Few speckles are dropped and few pixels a region has, so that small images keep something.
PipelineOptions options(int disparities, int min_disparity, const std::function<void(PipelineOptions&)>& change = {}) {
  PipelineOptions options;
  options.disparities = disparities;
  options.min_disparity = min_disparity;
  options.speckle_removal.max_size_px = 12;
  if (change) change(options);
  return options;
}

constexpr shared::ImageSize kSize{127, 61};

Setting standard() { return {"standard", kSize, options(32, 0)}; }

std::vector<Setting> settings() {
  std::vector<Setting> all{standard()};
  all.push_back({"negative_min_16bit_odd_stride", kSize, options(32, -10), PixelType::kU16, {.padding = 3}, 12.25});
  all.push_back({"bottom_up", kSize, options(37, -1), PixelType::kU8, {.padding = 5, .bottom_up = true}, 0, -0.8});
  PipelineOptions paper = PipelineOptions::paper();
  paper.disparities = 32;
  all.push_back({"paper", kSize, paper});
  all.push_back({"census5x5_four_paths_sad_check", kSize, options(24, 0, [](PipelineOptions& o) {
                   o.banded_sgm.cost = MatchingCost::kCensus5x5;
                   o.banded_sgm.paths = 4;
                   o.sad_check.max_difference = 9;
                 })});
  all.push_back({"sad3x3_sad_check_16bit", kSize,
                 options(24, 0,
                         [](PipelineOptions& o) {
                           o.banded_sgm.cost = MatchingCost::kSad3x3;
                           o.sad_check.max_difference = 6;
                         }),
                 PixelType::kU16});
  all.push_back({"sparse", kSize, options(24, 0, [](PipelineOptions& o) {
                   o.kalman_update.keep_predicted = false;
                   o.kalman_update.gate_px = 0.25f;
                   o.kalman_update.min_variance_px2 = 0.3f;
                   o.edge_variance.weight = 0.03f;
                   o.consistency = {.prediction_px = 0.5f, .measurement_px = 0.75f, .update_px = 1};
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
  all.push_back({"full_search", kSize, options(24, 0, [](PipelineOptions& o) { o.search = SearchMode::kFull; })});
  all.push_back({"not_temporal", kSize, options(24, 0, [](PipelineOptions& o) { o.temporal = false; })});
  all.push_back({"not_aligned_sharp_jumps", kSize, options(24, 0, [](PipelineOptions& o) {
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
           options(disparities, min, [](PipelineOptions& o) { o.speckle_removal.max_size_px = 2; }),
           disparities == 16 ? PixelType::kU16 : PixelType::kU8});
    }
  }
  return all;
}

std::string setting_name(const ::testing::TestParamInfo<Setting>& info) { return info.param.name; }

/// A covariance with all that the form in forward_warp.cpp takes.
Motion with_covariance(Motion motion) {
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
  reference::Images twin_images(int index) const {
    reference::Images images{pairs_[index].greys, setting_.type == PixelType::kU8 ? 8 : 16};
    if (images.bits == 8) {
      for (int& grey : images.greys) grey >>= 8;
    }
    return images;
  }
  reference::ViewMotions twin_motions(int index) const {
    Motion scaled = motion(index);
    scaled.covariance *= static_cast<double>(setting_.options.forward_warp.motion_noise);
    return {disparity_motion(calibration(), scaled, EGOSGM_LEFT),
            disparity_motion(calibration(), scaled, EGOSGM_RIGHT)};
  }

 private:
  Setting setting_;
  Scene scene_;
  std::vector<ScenePair> pairs_;
};

Pipeline make_pipeline(const Setting& setting) {
  return Pipeline(setting.scene().calibration(), setting.size.width, setting.size.height, setting.options);
}

reference::Pipeline make_twin(const Setting& setting) {
  return {setting.size, setting.options, BandedSgm::code_padding(testing::range_of(setting.options))};
}

/// What a frame gave.
struct Result {
  FrameReport report;
  OutputMemory outputs;
};

Result process(Pipeline& pipeline, const Setting& setting, const Video& video, int index,
               const std::optional<Motion>& motion) {
  Result result{{}, OutputMemory(setting.size, {setting.layout.padding, setting.layout.bottom_up})};
  const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
  result.report = pipeline.process(left.view(), right.view(), motion, result.outputs.views());
  return result;
}

Result process(Pipeline& pipeline, const Setting& setting, const Video& video, int index) {
  return process(pipeline, setting, video, index, video.motion(index));
}

std::vector<OutputMemory> process_all(Pipeline& pipeline, const Setting& setting, const Video& video) {
  std::vector<OutputMemory> outputs;
  for (int index = 0; index < video.size(); ++index) {
    outputs.push_back(process(pipeline, setting, video, index).outputs);
  }
  return outputs;
}

void expect_same(const std::string& stage, const testing::HostMaps& actual, const testing::HostMaps& expected,
                 shared::ImageSize size) {
  EXPECT_TRUE(testing::same_bits(actual.disparity, expected.disparity, size)) << "disparity of " << stage;
  EXPECT_TRUE(testing::same_bits(actual.variance, expected.variance, size)) << "variance of " << stage;
}

void expect_same(const reference::Pass& actual, const reference::Pass& expected, const Setting& setting) {
  const shared::ImageSize size = setting.size;
  const int padding = BandedSgm::code_padding(testing::range_of(setting.options));
  const int words = Census::words(setting.options.banded_sgm.cost);
  EXPECT_TRUE(testing::same_bits(actual.images, expected.images, size)) << "images";
  EXPECT_TRUE(testing::same_bits(actual.coarse, expected.coarse, CoarseMatch::coarse_size(size))) << "coarse match";
  EXPECT_TRUE(testing::same_bits(actual.band.bands, expected.band.bands, size)) << "bands";
  EXPECT_TRUE(testing::same_bits(actual.band.cell_offsets, expected.band.cell_offsets, size)) << "cell offsets";
  EXPECT_TRUE(testing::same_bits(actual.band.row_sums, expected.band.row_sums, {1, size.height})) << "row sums";
  EXPECT_TRUE(testing::same_bits(actual.codes, expected.codes, {(size.width + 2 * padding) * words, size.height}))
      << "codes";
  EXPECT_TRUE(testing::same_bits(actual.penalties, expected.penalties, size)) << "penalties";
  expect_same("matched", actual.matched, expected.matched, size);
  expect_same("smoothed", actual.smoothed, expected.smoothed, size);
  expect_same("consistent", actual.consistent, expected.consistent, size);
  expect_same("measured", actual.measured, expected.measured, size);
}

void expect_same(const reference::Frame& actual, const reference::Frame& expected, const Setting& setting) {
  expect_same("warped", actual.warped, expected.warped, setting.size);
  expect_same("without_edges", actual.without_edges, expected.without_edges, setting.size);
  expect_same("filled", actual.filled, expected.filled, setting.size);
  expect_same("predicted", actual.predicted, expected.predicted, setting.size);
  ASSERT_EQ(actual.passes.size(), expected.passes.size());
  for (std::size_t pass = 0; pass < actual.passes.size(); ++pass) {
    SCOPED_TRACE("pass " + std::to_string(pass));
    expect_same(actual.passes[pass], expected.passes[pass], setting);
  }
  expect_same("fused", actual.fused, expected.fused, setting.size);
  expect_same("fused_smoothed", actual.fused_smoothed, expected.fused_smoothed, setting.size);
  expect_same("fused_consistent", actual.fused_consistent, expected.fused_consistent, setting.size);
  expect_same("updated", actual.updated, expected.updated, setting.size);
  expect_same("result", actual.result, expected.result, setting.size);
}

template <typename T>
std::vector<T> half(const std::vector<T>& both, int view) {
  const std::ptrdiff_t pixels = static_cast<std::ptrdiff_t>(both.size() / 2);
  return {both.begin() + view * pixels, both.begin() + (view + 1) * pixels};
}

double valid_part(const std::vector<float>& disparity) {
  const auto valid = std::count_if(disparity.begin(), disparity.end(), [](float d) { return d > kInvalidDisparity; });
  return static_cast<double>(valid) / static_cast<double>(disparity.size());
}

void expect_outputs(const OutputMemory& outputs, const reference::Frame& expected, shared::ImageSize size) {
  const bool has_prediction = !expected.predicted.disparity.empty();
  const testing::HostMaps predicted = has_prediction ? expected.predicted : testing::empty_maps(size);
  const reference::Pass& pass = expected.passes.back();
  const testing::HostMaps& measured = has_prediction ? pass.measured : expected.result;  // they share memory
  const std::vector<float> maps[] = {half(expected.result.disparity, 0), half(expected.result.variance, 0),
                                     half(expected.result.disparity, 1), half(expected.result.variance, 1),
                                     half(predicted.disparity, 0),       half(predicted.variance, 0),
                                     half(measured.disparity, 0),        half(measured.variance, 0)};
  const auto actual = outputs.maps();
  for (std::size_t i = 0; i < actual.size(); ++i) {
    EXPECT_TRUE(testing::same_bits(actual[i].second->values(), maps[i], size)) << "output " << actual[i].first;
  }
  std::vector<std::uint16_t> widths;
  for (const shared::Band& band : half(pass.band.bands, 0)) {
    widths.push_back(static_cast<std::uint16_t>(band.last - band.first + 1));
  }
  EXPECT_TRUE(testing::same_bits(outputs.search_width.values(), widths, size)) << "output search_width";
  const std::vector<std::uint8_t> marks = dynamic_map(size, {}, maps[4], maps[6]);
  EXPECT_TRUE(testing::same_bits(outputs.dynamic.values(), marks, size)) << "output dynamic";
  EXPECT_TRUE(outputs.padding_is_untouched());
}

void expect_report(const FrameReport& report, const reference::Frame& expected, const Setting& setting) {
  double searched = 0, computed = 0;
  for (const shared::Band& band : expected.passes.back().band.bands) {
    searched += band.last - band.first + 1;
    computed += band.chunks * EGOSGM_LANES;
  }
  const double cells = 2.0 * setting.size.width * setting.size.height * setting.options.disparities;
  EXPECT_EQ(report.full_range, !expected.full_range_reason.empty());
  EXPECT_EQ(report.full_range_reason, expected.full_range_reason);
  EXPECT_NEAR(report.search_fraction, searched / cells, 1e-12);
  EXPECT_NEAR(report.computed_fraction, computed / cells, 1e-12);
  EXPECT_NEAR(report.density, valid_part(half(expected.result.disparity, 0)), 1e-12);
  EXPECT_EQ(static_cast<float>(report.vertical_offset_px), expected.vertical_offset_px);
  const double predicted = expected.predicted.disparity.empty() ? 0 : valid_part(half(expected.predicted.disparity, 0));
  EXPECT_NEAR(report.predicted_fraction, predicted, 1e-12);
}

class PipelineTest : public ::testing::TestWithParam<Setting> {};

TEST_P(PipelineTest, EveryStageOfThreeFramesEqualsItsTwin) {
  const Setting& setting = GetParam();
  const Video video(setting);
  testing::StageChain chain(video.calibration(), setting.size, setting.options, setting.type);
  reference::Pipeline twin = make_twin(setting);
  for (int index = 0; index < video.size(); ++index) {
    SCOPED_TRACE("frame " + std::to_string(index));
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    expect_same(chain.process(left.view(), right.view(), video.motion(index)),
                twin.process(video.twin_images(index), video.twin_motions(index)), setting);
  }
}

// Also over a frame without a motion, and a reset.
TEST_P(PipelineTest, EveryOutputOfAFrameEqualsItsTwin) {
  const Setting& setting = GetParam();
  const Video video(setting, 7);
  Pipeline pipeline = make_pipeline(setting);
  reference::Pipeline twin = make_twin(setting);
  for (int index = 0; index < video.size(); ++index) {
    SCOPED_TRACE("frame " + std::to_string(index));
    if (index == 5) pipeline.reset(), twin.reset();
    const bool has_motion = index != 3;
    const reference::Frame expected =
        twin.process(video.twin_images(index), has_motion ? std::optional(video.twin_motions(index)) : std::nullopt);
    const Result actual =
        process(pipeline, setting, video, index, has_motion ? std::optional(video.motion(index)) : std::nullopt);
    expect_outputs(actual.outputs, expected, setting.size);
    expect_report(actual.report, expected, setting);
  }
}

INSTANTIATE_TEST_SUITE_P(Settings, PipelineTest, ::testing::ValuesIn(settings()), setting_name);

// The scene has to reach every stage, or equality means nothing.
TEST(PipelineScene, ReachesEveryStage) {
  const Setting setting = standard();
  const Video video(setting, 2);
  reference::Pipeline twin = make_twin(setting);
  const reference::Frame first = twin.process(video.twin_images(0), {});
  const reference::Frame second = twin.process(video.twin_images(1), video.twin_motions(1));
  ASSERT_EQ(first.passes.size(), 2u);
  EXPECT_NEAR(first.passes[0].offset.offset_px, setting.vertical_offset_px, 0.3);
  const auto differ = [](const testing::HostMaps& a, const testing::HostMaps& b) { return a.disparity != b.disparity; };
  EXPECT_TRUE(differ(second.warped, second.without_edges));
  EXPECT_TRUE(differ(second.without_edges, second.filled));
  EXPECT_TRUE(differ(second.filled, second.predicted));
  const reference::Pass& pass = second.passes.back();
  EXPECT_TRUE(differ(pass.matched, pass.smoothed));
  EXPECT_TRUE(differ(pass.smoothed, pass.consistent));
  EXPECT_TRUE(differ(pass.consistent, pass.measured));
  EXPECT_TRUE(differ(second.fused, pass.measured));
  EXPECT_TRUE(differ(second.fused, second.fused_smoothed));
  EXPECT_TRUE(differ(second.fused_smoothed, second.fused_consistent));
}

TEST(Pipeline, FindsTheTrueDisparities) {
  Setting setting = standard();
  for (const double doffs_px : {0.0, 12.25}) {
    setting.doffs_px = doffs_px;
    setting.options.min_disparity = doffs_px > 0 ? -12 : 0;
    const Video video(setting, 5);
    Pipeline pipeline = make_pipeline(setting);
    for (int index = 0; index < video.size(); ++index) {
      const Result result = process(pipeline, setting, video, index);
      const ScenePair& truth = video.pair(index);
      const std::vector<float> estimates[2] = {result.outputs.disparity.values(),
                                               result.outputs.right_disparity.values()};
      for (int view = 0; view < 2; ++view) {
        int visible = 0, bad = 0;
        for (std::size_t i = 0; i < estimates[view].size(); ++i) {
          const std::size_t at = view * estimates[view].size() + i;
          if (!truth.is_visible[at]) continue;
          ++visible;
          bad += !(std::fabs(estimates[view][i] - truth.disparity[at]) <= 1.5f);  // a hole is bad
        }
        EXPECT_LT(bad, 0.07 * visible) << "frame " << index << ", view " << view;
      }
      EXPECT_NEAR(result.report.vertical_offset_px, setting.vertical_offset_px, 0.15) << "frame " << index;
      EXPECT_LT(result.report.search_fraction, index > 0 ? 0.4 : 1.1) << "frame " << index;
    }
  }
}

TEST(Pipeline, GivesTheSameBitsAgainAndElsewhere) {
  const Setting setting = standard();
  const Video video(setting);
  Pipeline pipeline = make_pipeline(setting);
  const std::vector<OutputMemory> expected = process_all(pipeline, setting, video);
  Pipeline other = make_pipeline(setting);
  EXPECT_TRUE(same_outputs(process_all(other, setting, video), expected, setting.size)) << "on a second pipeline";
  pipeline.reset();
  EXPECT_TRUE(same_outputs(process_all(pipeline, setting, video), expected, setting.size)) << "after a reset";
  Pipeline moved = std::move(other);
  moved.reset();
  EXPECT_TRUE(same_outputs(process_all(moved, setting, video), expected, setting.size)) << "after a move";
}

TEST(Pipeline, RunsInTwoThreads) {
  const Setting settings[2] = {standard(), Setting{"other", {65, 43}, options(37, -4)}};
  const Video videos[2] = {Video(settings[0]), Video(settings[1])};
  std::vector<OutputMemory> expected[2], actual[2];
  for (int i = 0; i < 2; ++i) {
    Pipeline pipeline = make_pipeline(settings[i]);
    expected[i] = process_all(pipeline, settings[i], videos[i]);
  }
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < 2; ++i) {
      threads.emplace_back([&, i] {
        Pipeline pipeline = make_pipeline(settings[i]);
        for (int repetition = 0; repetition < 4; ++repetition) {
          pipeline.reset();
          actual[i] = process_all(pipeline, settings[i], videos[i]);
          if (!same_outputs(actual[i], expected[i], settings[i].size)) return;
        }
      });
    }
  }
  EXPECT_TRUE(same_outputs(actual[0], expected[0], settings[0].size));
  EXPECT_TRUE(same_outputs(actual[1], expected[1], settings[1].size));
}

TEST(Pipeline, SaysWhyAFrameWasSearchedInFull) {
  Setting setting = standard();
  const Video video(setting, 3);
  Pipeline pipeline = make_pipeline(setting);
  const auto reason = [&](int index, bool has_motion) {
    const FrameReport report =
        process(pipeline, setting, video, index, has_motion ? std::optional(video.motion(index)) : std::nullopt).report;
    EXPECT_EQ(report.full_range, !report.full_range_reason.empty());
    EXPECT_EQ(report.full_range, report.search_fraction == 1) << report.search_fraction;
    return report.full_range_reason;
  };
  EXPECT_EQ(reason(0, true), "first frame");
  EXPECT_EQ(reason(1, true), "");
  EXPECT_EQ(reason(2, false), "no motion");
  EXPECT_EQ(reason(0, true), "");
  pipeline.reset();
  EXPECT_EQ(reason(1, true), "reset");
  EXPECT_EQ(reason(2, true), "");
  pipeline.reset();
  pipeline.reset();
  EXPECT_EQ(reason(0, false), "reset");

  setting.options.search = SearchMode::kFull;
  pipeline = make_pipeline(setting);
  EXPECT_EQ(reason(0, true), "first frame");
  EXPECT_EQ(reason(1, true), "search is full");
  setting.options.temporal = false;
  pipeline = make_pipeline(setting);
  EXPECT_EQ(reason(0, true), "not temporal");
  EXPECT_EQ(reason(1, true), "not temporal");
}

// The belief of the frame without a motion is what the next one predicts from.
TEST(Pipeline, PredictsAgainAfterAFrameWithoutMotion) {
  const Setting setting = standard();
  const Video video(setting, 3);
  Pipeline broken = make_pipeline(setting), fresh = make_pipeline(setting);
  process(broken, setting, video, 0);
  const Result gap = process(broken, setting, video, 1, std::nullopt);
  EXPECT_EQ(gap.report.predicted_fraction, 0);
  EXPECT_EQ(valid_part(gap.outputs.predicted.values()), 0);
  EXPECT_TRUE(testing::same_bits(gap.outputs.disparity.values(), gap.outputs.measured.values(), setting.size));
  const Result after = process(broken, setting, video, 2);
  EXPECT_FALSE(after.report.full_range);
  EXPECT_GT(after.report.predicted_fraction, 0.5);
  EXPECT_LT(after.report.search_fraction, 0.4);
}

TEST(Pipeline, WithoutTimeEveryFrameIsAlone) {
  Setting setting = standard();
  setting.options.temporal = false;
  setting.options.vertical_alignment.enabled = false;
  const Video video(setting, 3);
  Pipeline pipeline = make_pipeline(setting), other = make_pipeline(setting);
  process(pipeline, setting, video, 0);
  process(pipeline, setting, video, 1);
  const Result result = process(pipeline, setting, video, 2);
  const Result alone = process(other, setting, video, 2, std::nullopt);
  EXPECT_TRUE(same_outputs(result.outputs, alone.outputs, setting.size));
  EXPECT_TRUE(testing::same_bits(result.outputs.disparity.values(), result.outputs.measured.values(), setting.size));
  EXPECT_EQ(result.report.predicted_fraction, 0);
}

// With two frames under way at every moment, over a frame without a motion and a reset.
TEST_P(PipelineTest, SubmitAndCollectGiveTheBitsOfProcess) {
  const Setting& setting = GetParam();
  const Video video(setting, 6);
  Pipeline pipeline = make_pipeline(setting), overlapped = make_pipeline(setting);
  std::vector<Result> expected;
  std::vector<OutputMemory> outputs(video.size(), OutputMemory(setting.size));
  const auto collect = [&](int index) {
    EXPECT_TRUE(same_outputs(outputs[index], OutputMemory(setting.size), setting.size)) << "touched too early";
    const FrameReport report = overlapped.collect();
    EXPECT_TRUE(same_outputs(outputs[index], expected[index].outputs, setting.size)) << "frame " << index;
    EXPECT_EQ(report.full_range_reason, expected[index].report.full_range_reason) << "frame " << index;
    EXPECT_EQ(report.search_fraction, expected[index].report.search_fraction) << "frame " << index;
    EXPECT_EQ(report.density, expected[index].report.density) << "frame " << index;
    EXPECT_EQ(report.vertical_offset_px, expected[index].report.vertical_offset_px) << "frame " << index;
    EXPECT_EQ(report.launches, expected[index].report.launches) << "frame " << index;
  };
  for (int index = 0; index < video.size(); ++index) {
    const std::optional<Motion> motion = index != 2 ? std::optional(video.motion(index)) : std::nullopt;
    if (index == 4) pipeline.reset(), overlapped.reset();
    expected.push_back(process(pipeline, setting, video, index, motion));
    if (overlapped.under_way() == Pipeline::kMaxUnderWay) collect(index - Pipeline::kMaxUnderWay);
    // Images whose memory ends here.
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    overlapped.submit(left.view(), right.view(), motion, outputs[index].views());
  }
  collect(video.size() - 2);
  collect(video.size() - 1);
  EXPECT_EQ(overlapped.under_way(), 0);
}

TEST(Pipeline, RefusesFramesOutOfTurn) {
  const Setting setting = standard();
  const Video video(setting);
  Pipeline pipeline = make_pipeline(setting), overlapped = make_pipeline(setting);
  const std::vector<OutputMemory> expected = process_all(pipeline, setting, video);
  expect_refused([&] { overlapped.collect(); }, {"collect: no frame is under way"});
  std::vector<OutputMemory> outputs(3, OutputMemory(setting.size));
  const auto submit = [&](int index) {
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    overlapped.submit(left.view(), right.view(), video.motion(index), outputs[index].views());
  };
  submit(0);
  expect_refused([&] { process(overlapped, setting, video, 1); }, {"process: a frame that was submitted is under way"});
  submit(1);
  expect_refused([&] { submit(2); }, {"submit: 2 frames are under way"});
  overlapped.collect();
  submit(2);
  overlapped.collect();
  overlapped.collect();
  EXPECT_TRUE(same_outputs(outputs, expected, setting.size));
}

// With search=full the prediction is fused, but narrows nothing.
TEST(Pipeline, FullSearchStillFusesThePrediction) {
  Setting setting = standard();
  setting.options.search = SearchMode::kFull;
  const Video video(setting, 2);
  Pipeline pipeline = make_pipeline(setting);
  process(pipeline, setting, video, 0);
  const Result result = process(pipeline, setting, video, 1);
  EXPECT_NE(result.outputs.variance.values(), result.outputs.measured_variance.values());
  EXPECT_DOUBLE_EQ(result.report.search_fraction, 1);
  EXPECT_NEAR(result.report.predicted_fraction, valid_part(result.outputs.predicted.values()), 1e-12);
  EXPECT_GT(result.report.predicted_fraction, 0.5);
}

TEST(Pipeline, GivesTheSameBitsForEveryScheduling) {
  Setting setting = standard();
  const Video video(setting);
  std::vector<std::vector<OutputMemory>> results;
  for (const Scheduling scheduling : {Scheduling::kAutomatic, Scheduling::kWavefront, Scheduling::kPaths}) {
    setting.options.banded_sgm.scheduling = scheduling;
    Pipeline pipeline = make_pipeline(setting);
    results.push_back(process_all(pipeline, setting, video));
  }
  EXPECT_TRUE(same_outputs(results[1], results[0], setting.size));
  EXPECT_TRUE(same_outputs(results[2], results[0], setting.size));
}

TEST(Pipeline, GivesTheSameBitsForEveryTuning) {
  Setting setting = standard();
  const Video video(setting);
  Pipeline untuned = make_pipeline(setting);
  const std::vector<OutputMemory> expected = process_all(untuned, setting, video);
  const Tuning tunings[] = {
      {.tile_width = 16, .tile_height = 16, .warp_band_rows = 7, .speckle_strip_rows = 5, .row_group = 8},
      {.tile_width = 96, .tile_height = 5, .warp_band_rows = 100, .speckle_strip_rows = 1, .row_group = 1},
      {.path_lanes = 2, .path_lines = 3, .row_group = 64}};
  for (const Tuning& tuning : tunings) {
    setting.options.banded_sgm.scheduling = tuning.path_lanes > 0 ? Scheduling::kPaths : Scheduling::kWavefront;
    Pipeline pipeline(setting.scene().calibration(), setting.size.width, setting.size.height, setting.options,
                      Device::select().with_tuning(tuning));
    const std::vector<OutputMemory> actual = process_all(pipeline, setting, video);
    EXPECT_TRUE(same_outputs(actual, expected, setting.size)) << "tile width " << tuning.tile_width;
  }
}

TEST(Tuning, NamesEverySizeAndRefusesWhatCannotBe) {
  Tuning tuning;
  int value = 1;
  for (const NamedOption& size : list_tuning(tuning)) set_tuning(tuning, size.name, std::to_string(16 * value++));
  EXPECT_EQ(tuning.tile_width, 16);
  EXPECT_EQ(tuning.row_group, 16 * 7);
  expect_refused([&] { set_tuning(tuning, "tile_with", "1"); }, {"tile_with", "tile_width"});
  expect_refused([&] { set_tuning(tuning, "tile_width", "1.5"); }, {"tile_width", "1.5", "whole number"});
  const Device device = Device::select();
  const std::pair<Tuning, const char*> wrong[] = {{{.tile_width = 32, .tile_height = 33}, "tile_height is 33"},
                                                  {{.tile_width = 32}, "tile_height is 0"},
                                                  {{.tile_width = -1, .tile_height = 1}, "tile_width is -1"},
                                                  {{.path_lanes = 6, .path_lines = 1}, "path_lanes is 6"},
                                                  {{.path_lanes = 64, .path_lines = 8}, "path_lines is 8"},
                                                  {{.row_group = 257}, "row_group is 257"}};
  for (const auto& [sizes, what] : wrong) expect_refused([&] { device.with_tuning(sizes); }, {what});
}

TEST(Pipeline, GivesTheSameBitsForEveryLayoutOfRows) {
  Setting setting = standard();
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    setting.type = type;
    setting.layout = {};
    Pipeline pipeline = make_pipeline(setting);
    const std::vector<OutputMemory> expected = process_all(pipeline, setting, Video(setting));
    for (const Layout layout : {Layout{1, false}, {0, true}, {7, true}}) {
      setting.layout = layout;
      pipeline.reset();
      const std::vector<OutputMemory> actual = process_all(pipeline, setting, Video(setting));
      EXPECT_TRUE(same_outputs(actual, expected, setting.size))
          << "padding " << layout.padding << (layout.bottom_up ? ", bottom-up" : "");
      for (const OutputMemory& outputs : actual) EXPECT_TRUE(outputs.padding_is_untouched());
    }
  }
}

// One row has no next one that its stride could lead to.
TEST(Pipeline, TakesAnyStrideForASingleRow) {
  const shared::ImageSize size{40, 1};
  const Setting setting{"row", size, options(16, 0)};
  const Video video(setting, 1);
  Pipeline pipeline = make_pipeline(setting);
  const OutputMemory expected = process(pipeline, setting, video, 0).outputs;
  const ImageMemory left = video.image(0, EGOSGM_LEFT), right = video.image(0, EGOSGM_RIGHT);
  ImageView views[2] = {left.view(), right.view()};
  views[0].stride_bytes = 0, views[1].stride_bytes = -3;
  OutputMemory outputs(size);
  FrameOutputs maps = outputs.views();
  maps.disparity.stride_bytes = 0;
  pipeline.reset();
  pipeline.process(views[0], views[1], {}, maps);
  EXPECT_TRUE(same_outputs(outputs, expected, size));
}

// Comparisons of grey values do not change with their scale, and that of the SAD check is known.
TEST(Pipeline, GivesTheSameBitsForTheSameImagesWith16Bits) {
  Setting setting = standard();
  setting.options.vertical_alignment.enabled = false;  // resamples 16 bits more finely
  setting.options.sad_check.max_difference = 9;
  for (const MatchingCost cost : {MatchingCost::kCensus13x11, MatchingCost::kSad3x3}) {
    setting.options.banded_sgm.cost = cost;
    const Video video(setting);
    Pipeline pipeline_8 = make_pipeline(setting), pipeline_16 = make_pipeline(setting);
    for (int index = 0; index < video.size(); ++index) {
      std::vector<int> greys = video.pair(index).greys;
      for (int& grey : greys) grey = (grey >> 8) * 257;
      const ImageMemory left(setting.size, greys, EGOSGM_LEFT, PixelType::kU16);
      const ImageMemory right(setting.size, greys, EGOSGM_RIGHT, PixelType::kU16);
      OutputMemory outputs(setting.size);
      pipeline_16.process(left.view(), right.view(), video.motion(index), outputs.views());
      EXPECT_TRUE(same_outputs(outputs, process(pipeline_8, setting, video, index).outputs, setting.size))
          << "frame " << index << ", cost " << static_cast<int>(cost);
    }
  }
}

TEST(Pipeline, MayChangeTheTypeOfPixelsBetweenFrames) {
  Setting setting = standard();
  setting.options.vertical_alignment.enabled = false;
  const Video video(setting);
  Pipeline pipeline = make_pipeline(setting);
  const std::vector<OutputMemory> expected = process_all(pipeline, setting, video);
  pipeline.reset();
  for (int index = 0; index < video.size(); ++index) {
    std::vector<int> greys = video.pair(index).greys;
    for (int& grey : greys) grey = (grey >> 8) * 257;
    const PixelType type = index == 1 ? PixelType::kU16 : PixelType::kU8;
    const ImageMemory left(setting.size, greys, EGOSGM_LEFT, type), right(setting.size, greys, EGOSGM_RIGHT, type);
    OutputMemory outputs(setting.size);
    pipeline.process(left.view(), right.view(), video.motion(index), outputs.views());
    EXPECT_TRUE(same_outputs(outputs, expected[index], setting.size)) << "frame " << index;
  }
}

// The bits of the next frames do not depend on which outputs were asked for.
TEST(Pipeline, FillsOnlyWhatIsAskedFor) {
  const Setting setting = standard();
  const Video video(setting);
  Pipeline pipeline = make_pipeline(setting), silent = make_pipeline(setting);
  for (int index = 0; index < video.size(); ++index) {
    const Result expected = process(pipeline, setting, video, index);
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    OutputMemory outputs(setting.size);
    FrameOutputs wanted;
    if (index == 2) wanted.right_variance = outputs.right_variance.view();
    const FrameReport report = silent.process(left.view(), right.view(), video.motion(index), wanted);
    OutputMemory only(setting.size);
    if (index == 2) only.right_variance = expected.outputs.right_variance;
    EXPECT_TRUE(same_outputs(outputs, only, setting.size)) << "frame " << index;
    EXPECT_EQ(report.density, expected.report.density) << "frame " << index;
    EXPECT_EQ(report.launches, expected.report.launches) << "frame " << index;
  }
}

TEST(Pipeline, ReportsWhatItDid) {
  const Setting setting = standard();
  const Video video(setting, 4);
  Pipeline pipeline = make_pipeline(setting);
  const std::uint64_t memory = pipeline.device_memory_bytes();
  EXPECT_GT(memory, 2u * 127 * 61 * 32);
  EXPECT_EQ(pipeline.options().disparities, 32);
  EXPECT_EQ(pipeline.device().info().name, Device::select().info().name);
  std::vector<FrameReport> reports;
  for (int index = 0; index < video.size(); ++index) {
    reports.push_back(process(pipeline, setting, video, index).report);
    EXPECT_EQ(pipeline.device_memory_bytes(), memory) << "after frame " << index;
  }
  EXPECT_EQ(reports[2].launches, reports[3].launches);
  const auto stages = [](const FrameReport& report) {
    std::vector<std::string> names;
    for (const StageTime& time : report.stages) {
      EXPECT_GE(time.ms, 0) << time.stage;
      names.push_back(time.stage);
    }
    return names;
  };
  const std::vector<std::string> steady{"upload",           "ForwardWarp",       "EdgeRejection", "HoleFill",
                                        "ConsistencyCheck", "VerticalAlignment", "CoarseMatch",   "SearchBand",
                                        "Census",           "StepPenalties",     "BandedSgm",     "MedianFilter",
                                        "SpeckleRemoval",   "KalmanUpdate",      "EdgeVariance",  "download"};
  EXPECT_EQ(stages(reports[3]), steady);
  for (const FrameReport& report : reports) {
    EXPECT_GT(report.total_ms, 0);
    EXPECT_GT(report.launches, 15);
  }
}

TEST(Pipeline, ListsEveryCommandIfAsked) {
  const Setting setting = standard();
  const Video video(setting, 3);
  Pipeline pipeline = make_pipeline(setting);
  EXPECT_TRUE(process(pipeline, setting, video, 0).report.commands.empty());
  const auto host_ns = [] { return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1); };
  pipeline.record_commands(true);
  const std::int64_t before = host_ns();
  const FrameReport report = process(pipeline, setting, video, 1).report;
  const std::int64_t after = host_ns();
  double ms = 0, expected_ms = 0;
  for (const DeviceCommand& command : report.commands) {
    EXPECT_LE(command.queued_ns, command.submitted_ns) << command.name;
    EXPECT_LE(command.submitted_ns, command.started_ns) << command.name;
    EXPECT_LE(command.started_ns, command.ended_ns) << command.name;
    EXPECT_GE(command.queued_ns, before) << command.name;
    EXPECT_LE(command.ended_ns, after) << command.name;
    ms += 1e-6 * static_cast<double>(command.ended_ns - command.started_ns);
  }
  for (const StageTime& stage : report.stages) expected_ms += stage.ms;
  EXPECT_NEAR(ms, expected_ms, 1e-6 * expected_ms);
  const auto count = [&](auto&& fits) { return std::count_if(report.commands.begin(), report.commands.end(), fits); };
  EXPECT_EQ(count([](const auto& c) { return c.stage == "Census" && c.name == "census"; }), 1);
  EXPECT_EQ(count([](const auto& c) { return c.stage == "ConsistencyCheck"; }), 3);
  EXPECT_GE(count([](const auto& c) { return c.queue == DeviceQueue::kUpload; }), 1);
  EXPECT_GE(count([](const auto& c) { return c.queue == DeviceQueue::kDownload && c.name != "wait"; }), 10);
  EXPECT_GE(count([](const auto& c) { return c.queue == DeviceQueue::kKernels; }), report.launches);
  pipeline.record_commands(false);
  EXPECT_TRUE(process(pipeline, setting, video, 2).report.commands.empty());
}

TEST(Pipeline, KeepsEveryDisparityInItsRange) {
  for (const Setting& setting : settings()) {
    if (setting.size.width != 65 && setting.name != "negative_min_16bit_odd_stride") continue;
    const Video video(setting, 2);
    Pipeline pipeline = make_pipeline(setting);
    for (const OutputMemory& outputs : process_all(pipeline, setting, video)) {
      const std::vector<float> disparity = outputs.disparity.values(), variance = outputs.variance.values();
      for (std::size_t i = 0; i < disparity.size(); ++i) {
        const float min = static_cast<float>(setting.options.min_disparity);
        const float max = min + static_cast<float>(setting.options.disparities - 1);
        const bool is_valid = disparity[i] >= min && disparity[i] <= max && variance[i] > 0;
        ASSERT_TRUE(is_valid || (disparity[i] == kInvalidDisparity && variance[i] == 0))
            << setting.name << ": " << disparity[i] << ", variance " << variance[i];
      }
    }
  }
}

struct Frame {
  ImageView left, right;
  std::optional<Motion> motion;
  FrameOutputs outputs;
};

struct BadFrame {
  std::string what;  // part of the message
  std::function<void(Frame&)> spoil;
};

std::vector<BadFrame> bad_frames() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  return {
      {"left image: no data", [](Frame& f) { f.left.data = nullptr; }},
      {"right image: no data", [](Frame& f) { f.right.data = nullptr; }},
      {"left image: 126x61, the pipeline was built for 127x61", [](Frame& f) { f.left.width = 126; }},
      {"right image: 127x62", [](Frame& f) { f.right.height = 62; }},
      {"left image: -127x61", [](Frame& f) { f.left.width = -127; }},
      {"right image: 0x0", [](Frame& f) { f.right.width = f.right.height = 0; }},
      {"differ in type", [](Frame& f) { f.right.type = PixelType::kU16, f.right.stride_bytes = 254; }},
      {"left image: unknown pixel type", [](Frame& f) { f.left.type = static_cast<PixelType>(5); }},
      {"left image: a stride of 126 bytes is shorter than a row of 127", [](Frame& f) { f.left.stride_bytes = 126; }},
      {"right image: a stride of -126 bytes", [](Frame& f) { f.right.stride_bytes = -126; }},
      {"left image: a stride of 253 bytes is shorter than a row of 254",
       [](Frame& f) {
         f.left.type = f.right.type = PixelType::kU16;
         f.left.stride_bytes = 253;
       }},
      {"left image: a stride of 0 bytes", [](Frame& f) { f.left.stride_bytes = 0; }},
      {"output disparity: 126x61", [](Frame& f) { f.outputs.disparity.width = 126; }},
      {"output variance: 127x60", [](Frame& f) { f.outputs.variance.height = 60; }},
      {"output right_disparity: ", [](Frame& f) { f.outputs.right_disparity.width = 0; }},
      {"output right_variance: a stride of 507 bytes is shorter than a row of 508",
       [](Frame& f) { f.outputs.right_variance.stride_bytes = 507; }},
      {"output predicted: ", [](Frame& f) { f.outputs.predicted.height = 0; }},
      {"output predicted_variance: ", [](Frame& f) { f.outputs.predicted_variance.stride_bytes = 0; }},
      {"output measured: ", [](Frame& f) { f.outputs.measured.stride_bytes = -504; }},
      {"output measured_variance: ", [](Frame& f) { f.outputs.measured_variance.width = 128; }},
      {"output dynamic: a stride of 126 bytes is shorter than a row of 127",
       [](Frame& f) { f.outputs.dynamic.stride_bytes = 126; }},
      {"output search_width: a stride of 253 bytes is shorter than a row of 254",
       [](Frame& f) { f.outputs.search_width.stride_bytes = 253; }},
      {"motion: not all values are finite", [](Frame& f) { f.motion->current_from_previous.translation().x() = kNan; }},
      {"motion: its 3x3 part is not a rotation", [](Frame& f) { f.motion->current_from_previous.linear() *= 1.01; }},
      {"motion: its 3x3 part is not a rotation (R R^T differs from 1 by 0.0",
       [](Frame& f) { f.motion->current_from_previous.linear().col(0) *= -1; }},
      {"motion: the last row", [](Frame& f) { f.motion->current_from_previous.matrix()(3, 0) = 1; }},
      {"motion: the covariance", [](Frame& f) { f.motion->covariance(0, 0) = -1; }},
  };
}

TEST(Pipeline, RefusesBadFramesAndForgetsThem) {
  const Setting setting = standard();
  const Video video(setting);
  Pipeline pipeline = make_pipeline(setting);
  const std::vector<OutputMemory> expected = process_all(pipeline, setting, video);
  pipeline.reset();
  for (int index = 0; index < video.size(); ++index) {
    for (const BadFrame& bad : bad_frames()) {
      const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
      OutputMemory outputs(setting.size);
      Frame frame{left.view(), right.view(), video.motion(index), outputs.views()};
      bad.spoil(frame);
      expect_refused([&] { pipeline.process(frame.left, frame.right, frame.motion, frame.outputs); }, {bad.what});
      EXPECT_TRUE(same_outputs(outputs, OutputMemory(setting.size), setting.size)) << bad.what;
    }
    EXPECT_TRUE(same_outputs(process(pipeline, setting, video, index).outputs, expected[index], setting.size))
        << "frame " << index;
  }
}

TEST(Pipeline, RefusesWhatItCannotBeBuiltFor) {
  const Calibration calibration = Scene(kSize).calibration();
  const auto build = [&](int width, int height, const Calibration& c, const PipelineOptions& o) {
    return [=] { Pipeline(c, width, height, o); };
  };
  const PipelineOptions small = options(16, 0);
  expect_refused(build(0, 5, calibration, small), {"image size 0x5: choose 1x1 to 16384x16384"});
  expect_refused(build(5, 0, calibration, small), {"image size 5x0"});
  expect_refused(build(-5, 5, calibration, small), {"image size -5x5"});
  expect_refused(build(16385, 5, calibration, small), {"image size 16385x5"});
  expect_refused(build(5, 16385, calibration, small), {"image size 5x16385"});
  expect_refused(build(5, 5, {}, small), {"calibration: fx"});
  expect_refused(build(5, 5, calibration, options(0, 0)), {"option disparities is 0"});
}

}  // namespace
}  // namespace egosgm
