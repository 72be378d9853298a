// SPDX-License-Identifier: Apache-2.0
// Frames, sizes and options that a pipeline refuses, and forgets.
#include <gtest/gtest.h>

#include <limits>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "host/tuning_defaults.h"
#include "tests/support/expect_refused.h"
#include "tests/support/pipeline_video.h"

namespace egosgm::testing {
namespace {

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

TEST(Tuning, NamesEverySizeAndRefusesWhatCannotBe) {
  Tuning tuning;
  int value = 1;
  for (const NamedOption& size : list_tuning(tuning)) {
    set_tuning(tuning, size.name, size.name == "scheduling" ? "paths" : std::to_string(16 * value++));
  }
  EXPECT_EQ(tuning.scheduling, Scheduling::kPaths);
  EXPECT_EQ(tuning.tile_width, 16);
  EXPECT_EQ(tuning.row_group, 16 * 8);
  expect_refused([&] { set_tuning(tuning, "tile_with", "1"); }, {"tile_with", "tile_width"});
  expect_refused([&] { set_tuning(tuning, "tile_width", "1.5"); }, {"tile_width", "1.5", "whole number"});
  expect_refused([&] { set_tuning(tuning, "scheduling", "1"); }, {"scheduling", "automatic, wavefront, paths"});
  const Device device = Device::select();
  const std::pair<Tuning, const char*> wrong[] = {{{.tile_width = 32, .tile_height = 33}, "tile_height is 33"},
                                                  {{.tile_width = 32}, "tile_height is 0"},
                                                  {{.tile_width = -1, .tile_height = 1}, "tile_width is -1"},
                                                  {{.block_lanes = 24}, "block_lanes is 24"},
                                                  {{.block_lanes = 64}, "block_lanes is 64"},
                                                  {{.path_lanes = 6, .path_lines = 1}, "path_lanes is 6"},
                                                  {{.path_lanes = 64, .path_lines = 8}, "path_lines is 8"},
                                                  {{.row_group = 257}, "row_group is 257"}};
  for (const auto& [sizes, what] : wrong) expect_refused([&] { device.with_tuning(sizes); }, {what});
}

std::vector<std::string> sizes_of(const Tuning& tuning) {
  std::vector<std::string> sizes;
  for (const NamedOption& size : list_tuning(tuning)) sizes.push_back(size.name + " " + size.value);
  return sizes;
}

TEST(Tuning, TakesADevicesOwnSizesBeforeThoseOfItsClass) {
  DeviceInfo device;
  device.name = "Board";
  device.driver = "7";
  device.compute_units = kFewComputeUnits + 1;
  DeviceInfo small = device, gpu = device;
  small.compute_units = kFewComputeUnits;
  gpu.type = DeviceType::kGpu;
  EXPECT_EQ(sizes_of(with_defaults({}, device)), sizes_of(tuning_defaults().at("CPU")));
  EXPECT_EQ(sizes_of(with_defaults({}, small)), sizes_of(tuning_defaults().at("CPU of few units")));
  EXPECT_EQ(sizes_of(with_defaults({}, gpu)), sizes_of(tuning_defaults().at("GPU")));
  TuningDefaults defaults = tuning_defaults();
  defaults[tuning_key(device)] = {.tile_width = 96, .tile_height = 16};
  defaults["Board"] = {.scheduling = Scheduling::kPaths, .tile_width = 64, .tile_height = 8, .warp_band_rows = 5};
  const Tuning own = with_defaults({.row_group = 3}, device, defaults);
  EXPECT_EQ(sizes_of(own), sizes_of({.scheduling = Scheduling::kPaths,
                                     .tile_width = 96,
                                     .tile_height = 16,
                                     .warp_band_rows = 5,
                                     .speckle_strip_rows = tuning_defaults().at("CPU").speckle_strip_rows,
                                     .row_group = 3}));
  EXPECT_EQ(with_defaults({.scheduling = Scheduling::kWavefront}, device, defaults).scheduling, Scheduling::kWavefront);
}

TEST(Tuning, DefaultsAreSizesThatADeviceTakes) {
  for (const auto& [key, tuning] : tuning_defaults()) EXPECT_NO_THROW(tuning.validate()) << key;
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
      {"output predicted: ", [](Frame& f) { f.outputs.debug.predicted.height = 0; }},
      {"output predicted_variance: ", [](Frame& f) { f.outputs.debug.predicted_variance.stride_bytes = 0; }},
      {"output measured: ", [](Frame& f) { f.outputs.debug.measured.stride_bytes = -504; }},
      {"output measured_variance: ", [](Frame& f) { f.outputs.debug.measured_variance.width = 128; }},
      {"output dynamic: a stride of 126 bytes is shorter than a row of 127",
       [](Frame& f) { f.outputs.debug.dynamic.stride_bytes = 126; }},
      {"output reason: 127x62", [](Frame& f) { f.outputs.reason.height = 62; }},
      {"output search_width: a stride of 253 bytes is shorter than a row of 254",
       [](Frame& f) { f.outputs.debug.search_width.stride_bytes = 253; }},
      {"motion: not all values are finite", [](Frame& f) { f.motion->current_from_previous.translation().x() = kNan; }},
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
  constexpr auto kNone = static_cast<PixelType>(5);
  expect_refused([&] { Pipeline(calibration, 5, 5, small, Device::select(), kNone); }, {"unknown pixel type"});
  Pipeline pipeline(calibration, 5, 5, small);
  expect_refused([&] { pipeline.prepare(kNone, {}); }, {"unknown pixel type"});
}

}  // namespace
}  // namespace egosgm::testing
