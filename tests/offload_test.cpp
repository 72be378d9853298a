// SPDX-License-Identifier: Apache-2.0
// The same bits wherever a frame is computed: on parts of a device, by programs compiled ahead, without a compiler, and
// on the caller's own queue and memory.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <thread>

#include "egosgm/error.h"
#include "egosgm/opencl.h"
#include "egosgm/programs.h"
#include "host/ocl/device_handle.h"
#include "tests/support/expect_refused.h"
#include "tests/support/fault_layer.h"
#include "tests/support/short_video.h"

namespace egosgm {
namespace {

namespace fs = std::filesystem;
using testing::expect_refused;
using testing::OutputMemory;
using testing::Scene;
using testing::ShortVideo;

TEST(ComputeUnits, GiveTheBitsOfTheWholeDevice) {
  const Device whole = Device::select();
  const int units = whole.info().compute_units;
  if (units < 2) GTEST_SKIP() << "the device has one compute unit";
  const ShortVideo video;
  const std::vector<OutputMemory> expected = video.through(whole);
  std::vector<std::vector<OutputMemory>> actual(3);
  {
    std::vector<std::jthread> threads;  // all at once, as a batch uses them
    threads.emplace_back([&] { actual[0] = video.through(whole.compute_units(0, 0)); });
    threads.emplace_back([&] { actual[1] = video.through(whole.compute_units(units - 1, units - 1)); });
    threads.emplace_back([&] { actual[2] = video.through(whole.compute_units(0, units - 1)); });
  }
  for (const auto& outputs : actual) EXPECT_TRUE(same_outputs(outputs, expected, ShortVideo::kSize));
}

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write(const fs::path& file, const std::string& bytes) { std::ofstream(file, std::ios::binary) << bytes; }

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

/// A folder with the programs of ShortVideo::options(), compiled once for all tests.
class CompiledTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const testing::FaultLayer layer(FAULT_LAYER);
    folder_ = fs::path(::testing::TempDir()) / ("egosgm_programs_" + std::to_string(getpid()));
    fs::create_directory(folder_);
    for (const Scheduling scheduling : {Scheduling::kWavefront, Scheduling::kPaths}) {
      const fs::path folder = folder_ / (scheduling == Scheduling::kPaths ? "paths" : "wavefront");
      fs::create_directory(folder);
      for (const ProgramFile& file : compile_programs(Device::select(), options(scheduling))) {
        write(folder / file.name, file.bytes);
      }
    }
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  void TearDown() override { layer_.forbid_sources(0); }

  static PipelineOptions options(Scheduling scheduling) {
    PipelineOptions options = ShortVideo::options();
    options.banded_sgm.scheduling = scheduling;
    return options;
  }

  /// A copy of the folder to break.
  static fs::path copied() {
    const fs::path copy = folder_ / "copy";
    fs::remove_all(copy);
    fs::copy(folder_ / "wavefront", copy);
    return copy;
  }
  static void expect_no_pipeline(const fs::path& folder, const std::vector<std::string>& named) {
    const auto build = [&] {
      ShortVideo().pipeline(Device::select().with_programs(folder), options(Scheduling::kWavefront));
    };
    expect_refused(build, named);
  }

  const testing::FaultLayer layer_{FAULT_LAYER};
  static inline fs::path folder_;
};

TEST_F(CompiledTest, ProgramsGiveTheSameBitsAndNeedNoSource) {
  const Device device = Device::select();
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    const ShortVideo video(type);
    const std::vector<OutputMemory> expected = video.through(device);
    for (const Scheduling scheduling : {Scheduling::kWavefront, Scheduling::kPaths}) {
      const fs::path folder = folder_ / (scheduling == Scheduling::kPaths ? "paths" : "wavefront");
      layer_.forbid_sources(1);
      EXPECT_TRUE(
          same_outputs(video.through(device.with_programs(folder), options(scheduling)), expected, ShortVideo::kSize));
      EXPECT_THROW(video.through(device, options(scheduling)), DeviceError) << "the source was not forbidden";
      layer_.forbid_sources(0);
    }
  }
}

TEST_F(CompiledTest, ProgramsOfADeviceServeItsComputeUnits) {
  const Device device = Device::select();
  if (device.info().compute_units < 2) GTEST_SKIP() << "the device has one compute unit";
  const ShortVideo video;
  const PipelineOptions chosen = options(Scheduling::kWavefront);
  const std::vector<OutputMemory> expected = video.through(device, chosen);
  layer_.forbid_sources(1);
  const Device part = device.compute_units(1, 1).with_programs(folder_ / "wavefront");
  EXPECT_TRUE(same_outputs(video.through(part, chosen), expected, ShortVideo::kSize));
  const Device same = device.with_programs(folder_ / "wavefront").compute_units(1, 1);
  EXPECT_TRUE(same_outputs(video.through(same, chosen), expected, ShortVideo::kSize));
}

TEST_F(CompiledTest, ProgramsOfAnotherDeviceAreRefused) {
  const std::string manifest = read(folder_ / "wavefront/manifest.json");
  for (const std::string name : {"device", "device_version", "driver", "platform", "platform_version"}) {
    const fs::path folder = copied();
    const std::string field = '"' + name + "\": \"";
    write(folder / "manifest.json", replaced(manifest, field, field + "Other "));
    expect_no_pipeline(folder, {"manifest.json: made for " + name + " \"Other ", "here it is", "egosgm compile"});
  }
}

TEST_F(CompiledTest, ProgramsOfOtherSourceOrOptionsAreRefused) {
  fs::path folder = copied();
  const std::string manifest = read(folder / "manifest.json");
  const std::string field = "\"source_hash\": \"";
  const auto digit = manifest.find(field) + field.size();
  std::string changed = manifest;
  changed[digit] = changed[digit] == '0' ? '1' : '0';
  write(folder / "manifest.json", changed);
  expect_no_pipeline(folder, {"compiled from another version of the source", "egosgm compile"});

  folder = copied();
  write(folder / "manifest.json", replaced(manifest, "-DMAX_CHUNKS=2", "-DMAX_CHUNKS=3"));
  expect_no_pipeline(folder, {"has no banded_sgm.cl built with", "-DMAX_CHUNKS=2", "egosgm compile"});
}

TEST_F(CompiledTest, BrokenFoldersAreRefused) {
  expect_no_pipeline(folder_ / "nowhere", {"nowhere/manifest.json", "egosgm compile"});
  for (const std::string text : {"", "no JSON", "[]", "{}", "{\"format\": 2}", "{\"format\": 1}"}) {
    const fs::path folder = copied();
    write(folder / "manifest.json", text);
    expect_no_pipeline(folder, {"manifest.json", "egosgm compile"});
  }
  for (const auto& change : std::vector<std::function<void(const fs::path&)>>{
           [](const fs::path& file) { fs::resize_file(file, fs::file_size(file) - 1); },
           [](const fs::path& file) { write(file, ""); }, [](const fs::path& file) { fs::remove(file); }}) {
    const fs::path folder = copied();
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().filename().string().starts_with("banded_sgm-")) change(entry.path());
    }
    expect_no_pipeline(folder, {"banded_sgm-", ".bin", "egosgm compile"});
  }
}

/// A queue of the test's own, of the preferred device.
class OwnQueue {
 public:
  explicit OwnQueue(cl_command_queue_properties properties = 0) {
    cl_device_id device = Device::select().handle().device();
    context_ = clCreateContext(nullptr, 1, &device, nullptr, nullptr, nullptr);
    queue_ = clCreateCommandQueue(context_, device, properties, nullptr);
  }
  ~OwnQueue() {
    clReleaseCommandQueue(queue_);
    clReleaseContext(context_);
  }
  OwnQueue(const OwnQueue&) = delete;
  OwnQueue& operator=(const OwnQueue&) = delete;

  cl_command_queue get() const { return queue_; }
  cl_context context() const { return context_; }

  /// Both views of a frame.
  cl_mem upload(const ShortVideo& video, int index) const {
    const std::size_t bytes =
        ShortVideo::kSize.width * ShortVideo::kSize.height * (video.type() == PixelType::kU8 ? 1 : 2);
    cl_mem pixels = clCreateBuffer(context_, CL_MEM_READ_ONLY, 2 * bytes, nullptr, nullptr);
    for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
      clEnqueueWriteBuffer(queue_, pixels, CL_TRUE, view * bytes, bytes, video.image(index, view).data, 0, nullptr,
                           nullptr);
    }
    return pixels;
  }
  std::vector<float> view_of(cl_mem maps, int view) const {
    std::vector<float> values(static_cast<std::size_t>(ShortVideo::kSize.width) * ShortVideo::kSize.height);
    const std::size_t bytes = values.size() * sizeof(float);
    clEnqueueReadBuffer(queue_, maps, CL_TRUE, view * bytes, bytes, values.data(), 0, nullptr, nullptr);
    return values;
  }

 private:
  cl_context context_;
  cl_command_queue queue_;
};

cl_command_queue_properties queue_properties(const Device& device) {
  return device.handle().device.getInfo<CL_DEVICE_QUEUE_PROPERTIES>();
}

class DevicePipelineTest : public ::testing::Test {
 protected:
  DevicePipeline pipeline(const OwnQueue& queue, const PipelineOptions& options = ShortVideo::options()) const {
    const Scene scene(ShortVideo::kSize);
    return {queue.get(), scene.calibration(), ShortVideo::kSize.width, ShortVideo::kSize.height, options};
  }

  void expect_same(const OwnQueue& queue, const DeviceMaps& maps, const OutputMemory& expected) const {
    const auto same = [&](cl_mem map, int view, const std::vector<float>& values) {
      return testing::same_bits(queue.view_of(map, view), values, ShortVideo::kSize);
    };
    EXPECT_TRUE(same(maps.disparity, EGOSGM_LEFT, expected.disparity.values()));
    EXPECT_TRUE(same(maps.disparity, EGOSGM_RIGHT, expected.right_disparity.values()));
    EXPECT_TRUE(same(maps.variance, EGOSGM_LEFT, expected.variance.values()));
    EXPECT_TRUE(same(maps.variance, EGOSGM_RIGHT, expected.right_variance.values()));
  }

  const testing::FaultLayer layer_{FAULT_LAYER};
};

TEST_F(DevicePipelineTest, GivesTheBitsOfTheHostsWay) {
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    for (const cl_command_queue_properties profiling : {0, CL_QUEUE_PROFILING_ENABLE}) {
      const ShortVideo video(type);
      const std::vector<OutputMemory> expected = video.through(Device::select());
      const OwnQueue queue(profiling);
      DevicePipeline device = pipeline(queue);
      for (int index = 0; index < ShortVideo::kFrames; ++index) {
        cl_mem pixels = queue.upload(video, index);
        cl_event done = nullptr;
        const DeviceMaps maps = device.enqueue({pixels, type}, video.motion(index), &done);
        ASSERT_NE(done, nullptr);
        EXPECT_EQ(clWaitForEvents(1, &done), CL_SUCCESS);
        clReleaseEvent(done);
        EXPECT_EQ(maps.full_range, index == 0);
        EXPECT_EQ(maps.full_range_reason, index == 0 ? "first frame" : "");
        expect_same(queue, maps, expected[index]);
        clReleaseMemObject(pixels);
      }
    }
  }
}

// All frames are on the queue at once, behind a gate: whatever waited for the device would wait for ever.
TEST_F(DevicePipelineTest, WaitsForNothingAndCopiesNothing) {
  const ShortVideo video;
  const std::vector<OutputMemory> expected = video.through(Device::select());
  const OwnQueue queue;
  DevicePipeline device = pipeline(queue);
  std::vector<cl_mem> pixels;
  for (int index = 0; index < ShortVideo::kFrames; ++index) pixels.push_back(queue.upload(video, index));

  cl_event gate = clCreateUserEvent(queue.context(), nullptr);
  clEnqueueBarrierWithWaitList(queue.get(), 1, &gate, nullptr);
  const long buffers = layer_.buffers_created();
  const int transfers = layer_.transfers();
  DeviceMaps maps;
  for (int index = 0; index < ShortVideo::kFrames; ++index) {
    maps = device.enqueue({pixels[index], PixelType::kU8}, video.motion(index));
  }
  EXPECT_EQ(layer_.buffers_created(), buffers);
  EXPECT_EQ(layer_.transfers(), transfers);
  clSetUserEventStatus(gate, CL_COMPLETE);
  expect_same(queue, maps, expected.back());
  clReleaseEvent(gate);
  for (cl_mem memory : pixels) clReleaseMemObject(memory);
}

TEST_F(DevicePipelineTest, FramesOfTheHostGoInBetween) {
  const ShortVideo video;
  const std::vector<OutputMemory> expected = video.through(Device::select());
  const OwnQueue queue;
  DevicePipeline device = pipeline(queue);
  for (int round = 0; round < 2; ++round) {
    for (int index = 0; index < ShortVideo::kFrames; ++index) {
      if (index % 2 == round) {
        OutputMemory outputs(ShortVideo::kSize);
        device.host().process(video.image(index, EGOSGM_LEFT), video.image(index, EGOSGM_RIGHT), video.motion(index),
                              outputs.views());
        EXPECT_TRUE(same_outputs(outputs, expected[index], ShortVideo::kSize)) << index;
      } else {
        cl_mem pixels = queue.upload(video, index);
        expect_same(queue, device.enqueue({pixels, PixelType::kU8}, video.motion(index)), expected[index]);
        clReleaseMemObject(pixels);
      }
    }
    device.host().reset();
  }
}

TEST_F(DevicePipelineTest, GoesOnAfterAFrameThatFailed) {
  const ShortVideo video;
  const std::vector<OutputMemory> expected = video.through(Device::select());
  const OwnQueue queue;
  DevicePipeline device = pipeline(queue);
  std::vector<cl_mem> pixels;
  for (int index = 0; index < ShortVideo::kFrames; ++index) pixels.push_back(queue.upload(video, index));
  const auto enqueue = [&](int index) { return device.enqueue({pixels[index], PixelType::kU8}, video.motion(index)); };

  layer_.disarm();
  enqueue(0);
  const int enqueues = layer_.enqueues();
  device.host().reset();
  enqueue(0);
  for (int at = 0; at < enqueues; at += 7) {  // at once: the frame never was
    layer_.arm(at, CL_OUT_OF_RESOURCES, 0);
    EXPECT_THROW(for (;;) enqueue(1), DeviceError) << at;
    layer_.disarm();
    device.host().reset();
    expect_same(queue, enqueue(0), expected[0]);
    expect_same(queue, enqueue(1), expected[1]);
    device.host().reset();
    enqueue(0);
  }
  for (const bool asks_for_the_end : {false, true}) {  // on the device: the next frame says so
    layer_.arm(5, CL_OUT_OF_RESOURCES, 1);
    cl_event done = nullptr;
    try {
      device.enqueue({pixels[1], PixelType::kU8}, video.motion(1), asks_for_the_end ? &done : nullptr);
      layer_.disarm();
      clFinish(queue.get());
      EXPECT_THROW(enqueue(2), DeviceError);
    } catch (const DeviceError&) {  // it was quick, so the frame never was
      EXPECT_TRUE(asks_for_the_end);
      device.host().reset();
    }
    layer_.disarm();
    if (done) {
      EXPECT_NE(clWaitForEvents(1, &done), CL_SUCCESS);
      clReleaseEvent(done);
    }
  }
  for (int index = 0; index < ShortVideo::kFrames; ++index) {
    const DeviceMaps maps = enqueue(index);
    EXPECT_EQ(maps.full_range_reason, index == 0 ? "reset" : "");
    expect_same(queue, maps, expected[index]);
  }
  for (cl_mem memory : pixels) clReleaseMemObject(memory);
}

TEST_F(DevicePipelineTest, KeepsNothingOfTheCallers) {
  const ShortVideo video;
  const long before = layer_.references();
  {
    const OwnQueue queue;
    DevicePipeline device = pipeline(queue);
    cl_mem pixels = queue.upload(video, 0);
    device.enqueue({pixels, PixelType::kU8}, std::nullopt);
    clReleaseMemObject(pixels);
  }
  EXPECT_EQ(layer_.references(), before);
}

TEST_F(DevicePipelineTest, RefusesWhatDoesNotFit) {
  const ShortVideo video;
  const OwnQueue queue, other;
  const Calibration any{.fx = 9, .fy = 9, .cx = 3, .cy = 3, .baseline_m = 1};
  expect_refused([&] { DevicePipeline(nullptr, any, 8, 8); }, {"no queue"});
  if (queue_properties(Device::select()) & CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE) {
    const OwnQueue disordered(CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE);
    expect_refused([&] { DevicePipeline(disordered.get(), any, 8, 8); }, {"out of order"});
  }
  expect_refused([&] { DevicePipeline(queue.get(), any, 8, 8, {}, "no such folder"); },
                 {"no such folder/manifest.json"});
  DevicePipeline device = pipeline(queue);
  expect_refused([&] { device.enqueue({}, std::nullopt); }, {"no images"});
  cl_mem pixels = other.upload(video, 0);
  expect_refused([&] { device.enqueue({pixels, PixelType::kU8}, std::nullopt); }, {"another context"});
  clReleaseMemObject(pixels);
  pixels = queue.upload(video, 0);
  expect_refused(
      [&] {
        device.enqueue({pixels, PixelType::kU16}, std::nullopt);
      },
      {"15494 bytes", "needs 30988", "left image, then right image"});
  Motion bad;
  bad.current_from_previous.translation().x() = std::nan("");
  expect_refused([&] { device.enqueue({pixels, PixelType::kU8}, bad); }, {"otion"});
  device.host().submit(video.image(0, EGOSGM_LEFT), video.image(0, EGOSGM_RIGHT), std::nullopt, {});
  expect_refused([&] { device.enqueue({pixels, PixelType::kU8}, std::nullopt); }, {"collect it first"});
  device.host().collect();
  clReleaseMemObject(pixels);
}

}  // namespace
}  // namespace egosgm
