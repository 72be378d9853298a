// SPDX-License-Identifier: Apache-2.0
// The same bits whatever the circumstances: threads, scheduling, sizes, layout and type of pixels, what is asked for.
#include <gtest/gtest.h>

#include <thread>

#include "egosgm/pipeline.h"
#include "tests/support/pipeline_video.h"

namespace egosgm::testing {
namespace {

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

TEST(Pipeline, GivesTheSameBitsForEveryTuning) {
  Setting setting = standard();
  const Video video(setting);
  Pipeline untuned = make_pipeline(setting);
  const std::vector<OutputMemory> expected = process_all(untuned, setting, video);
  const Tuning tunings[] = {
      {.tile_width = 16, .tile_height = 16, .warp_band_rows = 7, .speckle_strip_rows = 5, .row_group = 8},
      {.tile_width = 96,
       .tile_height = 5,
       .block_lanes = 16,
       .warp_band_rows = 100,
       .speckle_strip_rows = 1,
       .row_group = 1},
      {.path_lanes = 2, .path_lines = 3, .row_group = 64}};
  for (const Tuning& tuning : tunings) {
    setting.options.banded_sgm.scheduling = tuning.path_lanes > 0 ? Scheduling::kPaths : Scheduling::kWavefront;
    Pipeline pipeline(setting.scene().calibration(), setting.size.width, setting.size.height, setting.options,
                      Device::select().with_tuning(tuning));
    const std::vector<OutputMemory> actual = process_all(pipeline, setting, video);
    EXPECT_TRUE(same_outputs(actual, expected, setting.size)) << "tile width " << tuning.tile_width;
  }
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
  for (const MatchingCost cost : {MatchingCost::kCensus9x7, MatchingCost::kSad3x3}) {
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

// The bits of the next frames do not depend on which outputs were asked for. But frame 3 knows nothing of what moves,
// since frame 2 was not asked for it.
TEST(Pipeline, FillsOnlyWhatIsAskedFor) {
  const Setting setting = standard();
  const Video video(setting);
  Pipeline pipeline = make_pipeline(setting), silent = make_pipeline(setting);
  MapMemory<std::uint8_t> unmarked(setting.size);
  for (int index = 0; index < video.size(); ++index) {
    Motion motion = video.motion(index);
    motion.current_from_previous.translation().x() += 0.2;  // so that all moves by itself
    const Result expected = process(pipeline, setting, video, index, motion);
    if (index == 0) unmarked = expected.outputs.dynamic;
    EXPECT_EQ(expected.outputs.dynamic == unmarked, index == 0);
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    OutputMemory outputs(setting.size);
    FrameOutputs wanted;
    if (index == 2) wanted.right_variance = outputs.right_variance.view();
    if (index != 2) wanted.debug.dynamic = outputs.dynamic.view();
    if (index == 3) wanted.reason = outputs.reason.view();
    const FrameReport report = silent.process(left.view(), right.view(), motion, wanted);
    OutputMemory only(setting.size);
    if (index == 2) only.right_variance = expected.outputs.right_variance;
    if (index < 2) only.dynamic = expected.outputs.dynamic;
    if (index == 3) only.dynamic = unmarked;
    if (index == 3) only.reason = expected.outputs.reason;
    EXPECT_TRUE(same_outputs(outputs, only, setting.size)) << "frame " << index;
    EXPECT_EQ(report.density, expected.report.density) << "frame " << index;
    EXPECT_LT(report.launches, expected.report.launches) << "what is not asked for is computed, frame " << index;
  }
}

}  // namespace
}  // namespace egosgm::testing
