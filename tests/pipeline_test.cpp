// SPDX-License-Identifier: Apache-2.0
// Whole frames: every stage and output against its reference, one frame after the other or two at a time, and the
// truth.
#include "egosgm/pipeline.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/reference/pipeline.h"
#include "tests/reference/present_rows.h"
#include "tests/reference/row_interpolation.h"
#include "tests/support/compare.h"
#include "tests/support/pipeline_video.h"
#include "tests/support/stage_chain.h"

namespace egosgm::testing {
namespace {

reference::Pipeline make_reference(const Setting& setting) {
  return {setting.size, setting.options, BandedSgm::code_padding(range_of(setting.options))};
}

/// Of a map of `size` the rows of `views`.
template <typename T>
std::vector<T> of_views(const std::vector<T>& both, Views views, shared::ImageSize size) {
  std::vector<T> present = both.empty() ? both : reference::without_absent_rows(size, views.row_step, both, T{});
  present.resize(both.size() / 2 * static_cast<std::size_t>(views.count));
  return present;
}

/// Of the maps that were looked at.
void expect_same(const std::string& stage, const HostMaps& actual, const HostMaps& expected, shared::ImageSize size,
                 Views views = Views::kBoth) {
  const auto same = [&](const auto& of_actual, const auto& of_expected) {
    return of_actual.empty() ? ::testing::AssertionSuccess()
                             : same_bits(of_views(of_actual, views, size), of_views(of_expected, views, size), size);
  };
  EXPECT_TRUE(same(actual.disparity, expected.disparity)) << "disparity of " << stage;
  EXPECT_TRUE(same(actual.variance, masked(expected).variance)) << "variance of " << stage;
  EXPECT_TRUE(same(actual.doubtful, expected.doubtful)) << "doubts of " << stage;
  EXPECT_TRUE(same(actual.hidden, expected.hidden)) << "hidden of " << stage;
}

/// `views`: that are matched.
void expect_same(const reference::Pass& actual, const reference::Pass& expected, const Setting& setting, Views views) {
  const shared::ImageSize size = setting.size;
  const int padding = BandedSgm::code_padding(range_of(setting.options));
  const int words = Census::words(setting.options.banded_sgm.cost);
  const auto same = [&](const auto& of_actual, const auto& of_expected, shared::ImageSize rows) {
    return same_bits(of_views(of_actual, views, rows), of_views(of_expected, views, rows), rows);
  };
  EXPECT_TRUE(same_bits(actual.images, expected.images, size)) << "images";
  EXPECT_TRUE(same_bits(actual.coarse, expected.coarse, shared::coarse_size(size))) << "coarse match";
  EXPECT_TRUE(same(actual.band.bands, expected.band.bands, size)) << "bands";
  EXPECT_TRUE(same(actual.band.cell_offsets, expected.band.cell_offsets, size)) << "cell offsets";
  EXPECT_TRUE(same(actual.band.row_sums, expected.band.row_sums, {1, size.height})) << "row sums";
  EXPECT_TRUE(same_bits(actual.codes, expected.codes, {(size.width + 2 * padding) * words, size.height})) << "codes";
  EXPECT_TRUE(same(actual.penalties, expected.penalties, {4 * size.width, size.height})) << "penalties";
  const Views measured{2, views.row_step};
  expect_same("matched", actual.matched, expected.matched, size, measured);
  expect_same("smoothed", actual.smoothed, expected.smoothed, size, measured);
  ASSERT_FALSE(actual.measured.disparity.empty());
  expect_same("measured", actual.measured, expected.measured, size, views);
}

void expect_same(const reference::Frame& actual, const reference::Frame& expected, const Setting& setting) {
  const Views tracked{expected.tracked_views, expected.row_step};
  const Views matched{expected.predicted.disparity.empty() ? 2 : tracked.count, expected.row_step};
  const Views both{2, tracked.row_step};
  expect_same("warped", actual.warped, expected.warped, setting.size, tracked);
  expect_same("without_edges", actual.without_edges, expected.without_edges, setting.size, tracked);
  expect_same("filled", actual.filled, expected.filled, setting.size, tracked);
  expect_same("predicted", actual.predicted, expected.predicted, setting.size, tracked);
  ASSERT_EQ(actual.predicted.disparity.empty(), expected.predicted.disparity.empty());
  ASSERT_EQ(actual.passes.size(), expected.passes.size());
  for (std::size_t pass = 0; pass < actual.passes.size(); ++pass) {
    SCOPED_TRACE("pass " + std::to_string(pass));
    expect_same(actual.passes[pass], expected.passes[pass], setting, matched);
  }
  expect_same("fused", actual.fused, expected.fused, setting.size, tracked);
  expect_same("fused_smoothed", actual.fused_smoothed, expected.fused_smoothed, setting.size, both);
  expect_same("updated", actual.updated, expected.updated, setting.size, both);
  expect_same("result", actual.result, expected.result, setting.size, both);
  if (Evidence::is_of(setting.options)) {
    EXPECT_EQ(of_views(actual.evidence, tracked, setting.size), of_views(expected.evidence, tracked, setting.size));
  }
  EXPECT_TRUE(same_bits(actual.output, expected.output, setting.size)) << "disparity that is published";
  EXPECT_TRUE(same_bits(actual.dynamic, expected.dynamic, setting.size)) << "dynamic map";
  EXPECT_TRUE(same_bits(actual.reasons, expected.reasons, setting.size)) << "reasons";
  EXPECT_TRUE(same_bits(actual.output_variance, expected.output_variance, setting.size)) << "output_variance";
}

template <typename T>
std::vector<T> half(const std::vector<T>& both, int view) {
  const std::ptrdiff_t pixels = static_cast<std::ptrdiff_t>(both.size() / 2);
  return {both.begin() + view * pixels, both.begin() + (view + 1) * pixels};
}

void expect_outputs(const OutputMemory& outputs, const reference::Frame& expected, shared::ImageSize size) {
  const bool has_prediction = !expected.predicted.disparity.empty();
  const int step = expected.row_step;
  const HostMaps predicted =
      reference::row_interpolation(size, step, has_prediction ? expected.predicted : empty_maps(size));
  const reference::Pass& pass = expected.passes.back();
  const HostMaps measured = reference::row_interpolation(size, step, pass.measured);
  std::vector<std::uint16_t> widths;
  for (const shared::Band& band : half(pass.band.bands, 0)) {
    const std::size_t row = widths.size() / size.width;
    const bool is_matched = row % expected.row_step == 0;
    widths.push_back(static_cast<std::uint16_t>(is_matched ? band.last - band.first + 1 : 0));
  }
  const auto expect_map = [&](const char* name, const auto& map, const auto& values) {
    EXPECT_TRUE(same_bits(map.values(), values, size)) << "output " << name;
  };
  expect_map("disparity", outputs.disparity, half(expected.output, 0));
  expect_map("variance", outputs.variance, half(expected.output_variance, 0));
  expect_map("right_disparity", outputs.right_disparity, half(expected.output, 1));
  expect_map("right_variance", outputs.right_variance, half(expected.output_variance, 1));
  expect_map("predicted", outputs.predicted, half(predicted.disparity, 0));
  expect_map("predicted_variance", outputs.predicted_variance, half(masked(predicted).variance, 0));
  expect_map("measured", outputs.measured, half(measured.disparity, 0));
  expect_map("measured_variance", outputs.measured_variance, half(masked(measured).variance, 0));
  expect_map("search_width", outputs.search_width, widths);
  expect_map("dynamic", outputs.dynamic, expected.dynamic);
  expect_map("reason", outputs.reason, expected.reasons);
  EXPECT_TRUE(outputs.padding_is_untouched());
}

void expect_report(const FrameReport& report, const reference::Frame& expected, const Setting& setting) {
  double searched = 0;
  const bool has_prediction = !expected.predicted.disparity.empty();
  const int views = has_prediction && !setting.options.track_right ? 1 : 2;
  for (const reference::Pass& pass : expected.passes) {
    for (std::size_t i = 0; i < views * pixel_count(setting.size); ++i) {
      const int row = static_cast<int>(i / setting.size.width), height = setting.size.height;
      if (row % height % expected.row_step == 0) searched += pass.band.bands[i].chunks * EGOSGM_LANES;
    }
    const int coarse_chunks = SearchBand::max_chunks(CoarseMatch::coarse_range(range_of(setting.options)));
    searched += static_cast<double>(pass.coarse.size() / 2) * coarse_chunks * EGOSGM_LANES;  // of the left view
  }
  const double cells = 1.0 * views * setting.size.width * setting.size.height * setting.options.disparities;
  EXPECT_EQ(to_string(report.unpredicted), expected.unpredicted);
  EXPECT_NEAR(report.search_fraction, searched / cells, 1e-12);
  EXPECT_NEAR(report.density, valid_part(half(expected.output, 0)), 1e-12);
  EXPECT_EQ(static_cast<float>(report.vertical_offset_px), expected.vertical_offset_px);
  const std::vector<float> of_matched_rows =
      reference::present_rows(setting.size, EGOSGM_LEFT, expected.row_step, expected.predicted.disparity);
  const double predicted = !has_prediction ? 0 : valid_part(of_matched_rows);
  EXPECT_NEAR(report.predicted_fraction, predicted, 1e-12);
}

class PipelineTest : public ::testing::TestWithParam<Setting> {};

TEST_P(PipelineTest, EveryStageOfThreeFramesEqualsItsReference) {
  const Setting& setting = GetParam();
  const Video video(setting);
  StageChain chain(video.calibration(), setting.size, setting.options, setting.type);
  reference::Pipeline reference = make_reference(setting);
  for (int index = 0; index < video.size(); ++index) {
    SCOPED_TRACE("frame " + std::to_string(index));
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    expect_same(chain.process(left.view(), right.view(), video.motion(index)),
                reference.process(video.reference_images(index), video.reference_motions(index)), setting);
  }
}

// Also over a frame without a motion, a reset, and a motion by which all that stands moves by itself.
TEST_P(PipelineTest, EveryOutputOfAFrameEqualsItsReference) {
  const Setting& setting = GetParam();
  const Video video(setting, 7);
  Pipeline pipeline = make_pipeline(setting);
  reference::Pipeline reference = make_reference(setting);
  for (int index = 0; index < video.size(); ++index) {
    SCOPED_TRACE("frame " + std::to_string(index));
    if (index == 5) pipeline.reset(), reference.reset();
    const bool has_motion = index != 3;
    Motion motion = video.motion(index);
    if (index == 6) motion.current_from_previous.translation().x() += 0.2;
    const reference::Frame expected = reference.process(
        video.reference_images(index), has_motion ? std::optional(video.reference_motions(motion)) : std::nullopt);
    const Result actual = process(pipeline, setting, video, index, has_motion ? std::optional(motion) : std::nullopt);
    expect_outputs(actual.outputs, expected, setting.size);
    if (index == 6 && setting.options.temporal && setting.size.width == kSize.width) {
      EXPECT_GT(std::count(expected.dynamic.begin(), expected.dynamic.end(), 255), 100);
    }
    expect_report(actual.report, expected, setting);
  }
}

INSTANTIATE_TEST_SUITE_P(Settings, PipelineTest, ::testing::ValuesIn(settings()), setting_name);

// Rows that are left out are filled in what is asked for, and in what that is made of. In the last frame, all that
// stands moves by itself.
TEST(Pipeline, AnOutputThatIsAskedForAloneHasTheSameBits) {
  const Setting setting = standard();
  const Video video(setting, 4);
  const auto motion_of = [&](int index) {
    Motion motion = video.motion(index);
    if (index == 3) motion.current_from_previous.translation().x() += 0.2;
    return motion;
  };
  Pipeline with_all = make_pipeline(setting);
  std::vector<OutputMemory> expected;
  for (int index = 0; index < video.size(); ++index) {
    expected.push_back(process(with_all, setting, video, index, motion_of(index)).outputs);
  }
  for (const OutputText& asked : output_texts()) {
    Pipeline pipeline = make_pipeline(setting);
    for (int index = 0; index < video.size(); ++index) {
      SCOPED_TRACE(asked.name + std::string(", frame ") + std::to_string(index));
      OutputMemory memory(setting.size, setting.layout);
      FrameOutputs outputs = memory.views();
      for_each_output(outputs, [&](const OutputText& text, auto& view) {
        if (text.output != asked.output) view = {};
      });
      const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
      pipeline.process(left.view(), right.view(), motion_of(index), outputs);
      OutputMemory::for_each_map([&](const char* name, auto map) {
        if (name != std::string(asked.name)) return;
        EXPECT_TRUE(same_bits((memory.*map).values(), (expected[index].*map).values(), setting.size));
      });
    }
  }
}

// The scene has to reach every stage, or equality means nothing.
TEST(PipelineScene, ReachesEveryStage) {
  const Setting setting = standard();
  const Video video(setting, 2);
  reference::Pipeline reference = make_reference(setting);
  const reference::Frame first = reference.process(video.reference_images(0), {});
  const reference::Frame second = reference.process(video.reference_images(1), video.reference_motions(1));
  ASSERT_EQ(first.passes.size(), 2u);
  EXPECT_NEAR(first.passes[0].offset.terms_px[0], setting.vertical_offset_px, 0.3);
  const auto differ = [](const HostMaps& a, const HostMaps& b) { return a.disparity != b.disparity; };
  EXPECT_TRUE(differ(second.warped, second.predicted));
  const reference::Pass& pass = second.passes.back();
  EXPECT_TRUE(differ(pass.matched, pass.smoothed));
  EXPECT_TRUE(differ(pass.smoothed, pass.consistent));
  EXPECT_TRUE(differ(first.passes.back().consistent, first.passes.back().measured));
  EXPECT_TRUE(differ(second.fused, pass.measured));
  EXPECT_TRUE(differ(second.fused, second.fused_smoothed));
  EXPECT_TRUE(differ(second.fused_smoothed, second.fused_consistent));
  EXPECT_NE(second.output, second.result.disparity);
}

// The reference knows a pair again; so does the pipeline, over a reset too.
// Three poses are given for frame 1: the pictures are of the first one, from which frame 2 is predicted.
TEST(Pipeline, KnowsARepeatedPairAgain) {
  const Setting setting = standard();
  const Video video(setting, 3);
  Pipeline pipeline = make_pipeline(setting);
  reference::Pipeline reference = make_reference(setting);
  std::vector<float> densities;
  const Motion away = video.motion(1), farther = video.motion(2);
  Motion back = video.motion(2);
  back.current_from_previous =
      back.current_from_previous * (farther * away).current_from_previous.inverse(Eigen::Isometry);
  for (const auto& [index, given, moved] : {std::tuple{0, Motion(), Motion()},
                                            {1, video.motion(1), video.motion(1)},
                                            {1, away, Motion()},
                                            {1, farther, Motion()},
                                            {2, back, back * (farther * away)}}) {
    const reference::Frame expected = reference.process(video.reference_images(index), video.reference_motions(moved));
    const Result actual = process(pipeline, setting, video, index, given);
    expect_outputs(actual.outputs, expected, setting.size);
    EXPECT_EQ(actual.report.repeated, densities.size() == 2 || densities.size() == 3);
    densities.push_back(static_cast<float>(actual.report.density));
  }
  EXPECT_NEAR(densities[2], densities[1], 0.01f);
  EXPECT_NEAR(densities[3], densities[1], 0.01f);
  EXPECT_GT(densities[4], densities[1] - 0.05f);
  pipeline.reset(), reference.reset();
  const Result anew = process(pipeline, setting, video, 2);
  expect_outputs(anew.outputs, reference.process(video.reference_images(2), video.reference_motions(2)), setting.size);
  EXPECT_FALSE(anew.report.repeated);
  expect_outputs(process(pipeline, setting, video, 2, std::nullopt).outputs,
                 reference.process(video.reference_images(2), std::nullopt), setting.size);
}

TEST(Pipeline, RecoversFromAWrongMotion) {
  const Setting setting = standard();
  const Video video(setting, 6);
  Pipeline pipeline = make_pipeline(setting), undisturbed = make_pipeline(setting);
  reference::Pipeline reference = make_reference(setting);
  constexpr int kWrong = 2;
  for (int index = 0; index < video.size(); ++index) {
    SCOPED_TRACE("frame " + std::to_string(index));
    Motion motion = video.motion(index);
    if (index == kWrong) motion.current_from_previous.translation().z() -= 1;
    const reference::Frame expected = reference.process(video.reference_images(index), video.reference_motions(motion));
    const Result actual = process(pipeline, setting, video, index, motion);
    const Result usual = process(undisturbed, setting, video, index);
    expect_outputs(actual.outputs, expected, setting.size);
    expect_report(actual.report, expected, setting);
    EXPECT_EQ(actual.report.predicted_fraction > 0.5, index != 0);
    EXPECT_EQ(actual.report.searched_everything, index == 0);
    EXPECT_EQ(actual.outputs.disparity.values() == usual.outputs.disparity.values(), index < kWrong);
    if (index > kWrong) {
      EXPECT_GT(actual.report.density, usual.report.density - 0.02);
    }
  }
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
      EXPECT_LT(result.report.search_fraction, index > 0 ? 0.6 : 2.1) << "frame " << index;
    }
  }
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
    EXPECT_EQ(report.unpredicted, expected[index].report.unpredicted) << "frame " << index;
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

}  // namespace
}  // namespace egosgm::testing
