// SPDX-License-Identifier: Apache-2.0
// What a frame reports, what it was predicted from, and what range its disparities keep.
#include <gtest/gtest.h>

#include <chrono>
#include <set>

#include "egosgm/pipeline.h"
#include "tests/support/compare.h"
#include "tests/support/pipeline_video.h"

namespace egosgm::testing {
namespace {

// What is predicted and what is searched are two things: with `search=full`, a frame is predicted and searches
// everything.
TEST(Pipeline, SaysWhyNothingWasPredictedAndWhatWasSearched) {
  Setting setting = standard();
  const Video video(setting, 3);
  Pipeline pipeline = make_pipeline(setting);
  const auto unpredicted = [&](int index, bool has_motion) {
    const FrameReport report =
        process(pipeline, setting, video, index, has_motion ? std::optional(video.motion(index)) : std::nullopt).report;
    EXPECT_EQ(report.searched_everything,
              report.unpredicted.has_value() || setting.options.search == SearchMode::kFull);
    EXPECT_EQ(report.searched_everything, report.search_fraction >= 1) << report.search_fraction;
    EXPECT_EQ(report.predicted_fraction > 0, !report.unpredicted);
    return report.unpredicted;
  };
  EXPECT_EQ(unpredicted(0, true), Unpredicted::kFirstFrame);
  EXPECT_EQ(unpredicted(1, true), std::nullopt);
  EXPECT_EQ(unpredicted(2, false), Unpredicted::kNoMotion);
  EXPECT_EQ(unpredicted(0, true), std::nullopt);
  pipeline.reset();
  EXPECT_EQ(unpredicted(1, true), Unpredicted::kReset);
  EXPECT_EQ(unpredicted(2, true), std::nullopt);
  pipeline.reset();
  pipeline.reset();
  EXPECT_EQ(unpredicted(0, false), Unpredicted::kReset);

  setting.options.search = SearchMode::kFull;
  pipeline = make_pipeline(setting);
  EXPECT_EQ(unpredicted(0, true), Unpredicted::kFirstFrame);
  EXPECT_EQ(unpredicted(1, true), std::nullopt);
  setting.options.temporal = false;
  pipeline = make_pipeline(setting);
  EXPECT_EQ(unpredicted(0, true), Unpredicted::kNotTemporal);
  EXPECT_EQ(unpredicted(1, true), Unpredicted::kNotTemporal);
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
  for (const FrameReport& report : reports) {
    std::set<std::string> names;
    for (const StageTime& time : report.stages) {
      EXPECT_GE(time.ms, 0) << time.stage;
      EXPECT_TRUE(names.insert(time.stage).second) << time.stage << " is there twice";
    }
    EXPECT_EQ(report.stages.front().stage, "upload");
    EXPECT_EQ(report.stages.back().stage, "download");
    EXPECT_EQ(names.contains("ForwardWarp"), !report.unpredicted);
    EXPECT_TRUE(names.contains("BandedSgm"));
    EXPECT_GT(report.total_ms, 0);
    EXPECT_GT(report.launches, 0);
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
  std::set<std::string> stages, expected_stages;
  for (const DeviceCommand& command : report.commands) {
    stages.insert(command.stage);
    EXPECT_LE(command.queued_ns, command.submitted_ns) << command.name;
    EXPECT_LE(command.submitted_ns, command.started_ns) << command.name;
    EXPECT_LE(command.started_ns, command.ended_ns) << command.name;
    EXPECT_GE(command.queued_ns, before) << command.name;
    EXPECT_LE(command.ended_ns, after) << command.name;
    ms += 1e-6 * static_cast<double>(command.ended_ns - command.started_ns);
  }
  for (const StageTime& stage : report.stages) expected_ms += stage.ms, expected_stages.insert(stage.stage);
  EXPECT_EQ(stages, expected_stages);
  EXPECT_NEAR(ms, expected_ms, 1e-6 * expected_ms);
  const auto count = [&](auto&& fits) { return std::count_if(report.commands.begin(), report.commands.end(), fits); };
  EXPECT_EQ(count([](const auto& c) { return c.stage == "Census" && c.name == "census"; }), 1);
  EXPECT_GE(count([](const auto& c) { return c.queue == DeviceQueue::kUpload; }), 1);
  EXPECT_GE(count([](const auto& c) { return c.queue == DeviceQueue::kDownload && c.name != "wait"; }), 1);
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

}  // namespace
}  // namespace egosgm::testing
