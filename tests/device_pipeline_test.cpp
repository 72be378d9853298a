// SPDX-License-Identifier: Apache-2.0
// The same bits on the caller's own queue, with images in its buffers or in shared virtual memory.
#define CL_TARGET_OPENCL_VERSION 200  // for clSVMAlloc
#define CL_USE_DEPRECATED_OPENCL_1_2_APIS
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "egosgm/error.h"
#include "egosgm/opencl.h"
#include "host/method_options.h"
#include "host/ocl/device_handle.h"
#include "tests/support/expect_refused.h"
#include "tests/support/fault_layer.h"
#include "tests/support/short_video.h"

namespace egosgm {
namespace {

using testing::expect_refused;
using testing::OutputMemory;
using testing::Scene;
using testing::ShortVideo;

std::size_t view_bytes(PixelType type) {
  return static_cast<std::size_t>(ShortVideo::kSize.width) * ShortVideo::kSize.height *
         (type == PixelType::kU8 ? 1 : 2);
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
    const std::size_t bytes = view_bytes(video.type());
    cl_mem pixels = clCreateBuffer(context_, CL_MEM_READ_ONLY, 2 * bytes, nullptr, nullptr);
    for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
      clEnqueueWriteBuffer(queue_, pixels, CL_TRUE, view * bytes, bytes, video.image(index, view).data, 0, nullptr,
                           nullptr);
    }
    return pixels;
  }
  template <typename T = float>
  std::vector<T> view_of(cl_mem maps, int view) const {
    std::vector<T> values(static_cast<std::size_t>(ShortVideo::kSize.width) * ShortVideo::kSize.height);
    const std::size_t bytes = values.size() * sizeof(T);
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

DevicePipeline pipeline_on(const OwnQueue& queue) {
  const Scene scene(ShortVideo::kSize);
  return {queue.get(), scene.calibration(), ShortVideo::kSize.width, ShortVideo::kSize.height, ShortVideo::options()};
}

/// A short video's frames in the memory of a queue, a pipeline on it, and what the host's way gives.
struct VideoOnDevice {
  const ShortVideo video;
  const OwnQueue queue;
  const std::vector<OutputMemory> expected;
  std::vector<cl_mem> pixels;
  DevicePipeline device = pipeline_on(queue);

  explicit VideoOnDevice(PixelType type = PixelType::kU8, cl_command_queue_properties properties = 0)
      : video(type), queue(properties), expected(video.through(Device::select())) {
    for (int index = 0; index < ShortVideo::kFrames; ++index) pixels.push_back(queue.upload(video, index));
  }
  ~VideoOnDevice() {
    for (cl_mem memory : pixels) clReleaseMemObject(memory);
  }
  VideoOnDevice(const VideoOnDevice&) = delete;
  VideoOnDevice& operator=(const VideoOnDevice&) = delete;

  DeviceMaps enqueue(int index, cl_event* done = nullptr) {
    return device.enqueue({pixels[index], video.type()}, video.motion(index), done, /*wants_dynamic=*/true);
  }
  void expect_same(const DeviceMaps& maps, int index) const {
    const auto same = [&](cl_mem map, int view, const testing::MapMemory<float>& values) {
      return testing::same_bits(queue.view_of(map, view), values.values(), ShortVideo::kSize);
    };
    EXPECT_TRUE(same(maps.disparity, EGOSGM_LEFT, expected[index].disparity)) << index;
    EXPECT_TRUE(same(maps.disparity, EGOSGM_RIGHT, expected[index].right_disparity)) << index;
    EXPECT_TRUE(same(maps.variance, EGOSGM_LEFT, expected[index].variance)) << index;
    EXPECT_TRUE(same(maps.variance, EGOSGM_RIGHT, expected[index].right_variance)) << index;
    EXPECT_TRUE(testing::same_bits(queue.view_of<std::uint8_t>(maps.dynamic, EGOSGM_LEFT),
                                   expected[index].dynamic.values(), ShortVideo::kSize))
        << index;
  }
};

class DevicePipelineTest : public ::testing::Test {
 protected:
  const testing::FaultLayer layer_{FAULT_LAYER};
};

TEST_F(DevicePipelineTest, GivesTheBitsOfTheHostsWay) {
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    for (const cl_command_queue_properties profiling : {0, CL_QUEUE_PROFILING_ENABLE}) {
      VideoOnDevice frames(type, profiling);
      for (int index = 0; index < ShortVideo::kFrames; ++index) {
        cl_event done = nullptr;
        const DeviceMaps maps = frames.enqueue(index, &done);
        ASSERT_NE(done, nullptr);
        EXPECT_EQ(clWaitForEvents(1, &done), CL_SUCCESS);
        clReleaseEvent(done);
        EXPECT_EQ(maps.unpredicted, index == 0 ? std::optional(Unpredicted::kFirstFrame) : std::nullopt);
        frames.expect_same(maps, index);
      }
    }
  }
}

// All frames are on the queue at once, behind a gate: whatever waited for the device would wait for ever.
TEST_F(DevicePipelineTest, WaitsForNothingAndCopiesNothing) {
  VideoOnDevice frames;
  cl_event gate = clCreateUserEvent(frames.queue.context(), nullptr);
  clEnqueueBarrierWithWaitList(frames.queue.get(), 1, &gate, nullptr);
  const long buffers = layer_.buffers_created();
  const int transfers = layer_.transfers();
  DeviceMaps maps;
  for (int index = 0; index < ShortVideo::kFrames; ++index) maps = frames.enqueue(index);
  EXPECT_EQ(layer_.buffers_created(), buffers);
  EXPECT_EQ(layer_.transfers(), transfers);
  clSetUserEventStatus(gate, CL_COMPLETE);
  frames.expect_same(maps, ShortVideo::kFrames - 1);
  clReleaseEvent(gate);
}

TEST_F(DevicePipelineTest, FramesOfTheHostGoInBetween) {
  VideoOnDevice frames;
  const ShortVideo& video = frames.video;
  for (int round = 0; round < 2; ++round) {
    for (int index = 0; index < ShortVideo::kFrames; ++index) {
      if (index % 2 == round) {
        OutputMemory outputs(ShortVideo::kSize);
        frames.device.host().process(video.image(index, EGOSGM_LEFT), video.image(index, EGOSGM_RIGHT),
                                     video.motion(index), outputs.views());
        EXPECT_TRUE(same_outputs(outputs, frames.expected[index], ShortVideo::kSize)) << index;
      } else {
        frames.expect_same(frames.enqueue(index), index);
      }
    }
    frames.device.host().reset();
  }
}

TEST_F(DevicePipelineTest, GoesOnAfterAFrameThatFailed) {
  VideoOnDevice frames;
  layer_.disarm();
  frames.enqueue(0);
  const int enqueues = layer_.enqueues();
  frames.device.host().reset();
  frames.enqueue(0);
  for (int at = 0; at < enqueues; at += 7) {  // at once: the frame never was
    layer_.arm(at, CL_OUT_OF_RESOURCES, 0);
    EXPECT_THROW(for (;;) frames.enqueue(1), DeviceError) << at;
    layer_.disarm();
    frames.device.host().reset();
    frames.expect_same(frames.enqueue(0), 0);
    frames.expect_same(frames.enqueue(1), 1);
    frames.device.host().reset();
    frames.enqueue(0);
  }
  for (const bool asks_for_the_end : {false, true}) {  // on the device: the next frame says so
    layer_.arm(5, CL_OUT_OF_RESOURCES, 1);
    cl_event done = nullptr;
    try {
      frames.enqueue(1, asks_for_the_end ? &done : nullptr);
      layer_.disarm();
      clFinish(frames.queue.get());
      EXPECT_THROW(frames.enqueue(2), DeviceError);
    } catch (const DeviceError&) {  // it was quick, so the frame never was
      EXPECT_TRUE(asks_for_the_end);
      frames.device.host().reset();
    }
    layer_.disarm();
    if (done) {
      EXPECT_NE(clWaitForEvents(1, &done), CL_SUCCESS);
      clReleaseEvent(done);
    }
  }
  Pipeline& host = frames.device.host();
  for (const bool is_of_host : {false, true}) {  // with another frame behind it
    layer_.arm(5, CL_OUT_OF_RESOURCES, testing::FaultLayer::kHeld);
    frames.enqueue(0);
    if (is_of_host) {
      host.submit(frames.video.image(1, EGOSGM_LEFT), frames.video.image(1, EGOSGM_RIGHT), std::nullopt, {});
    } else {
      frames.enqueue(1);
    }
    layer_.disarm();
    EXPECT_THROW(is_of_host ? void(host.collect()) : void(frames.enqueue(2)), DeviceError);
    EXPECT_EQ(host.under_way(), 0);
    layer_.disarm();
  }
  for (int index = 0; index < ShortVideo::kFrames; ++index) {
    const DeviceMaps maps = frames.enqueue(index);
    EXPECT_EQ(maps.unpredicted, index == 0 ? std::optional(Unpredicted::kReset) : std::nullopt);
    frames.expect_same(maps, index);
  }
}

TEST_F(DevicePipelineTest, ADynamicMapThatIsNotAskedForCostsNothing) {
  VideoOnDevice frames;
  DevicePipeline without = pipeline_on(frames.queue);
  for (int index = 0; index < ShortVideo::kFrames; ++index) {
    layer_.disarm();  // counts from here
    EXPECT_NE(frames.enqueue(index).dynamic, nullptr);
    const int enqueues = layer_.enqueues();
    layer_.disarm();
    const DeviceMaps maps = without.enqueue({frames.pixels[index], frames.video.type()}, frames.video.motion(index));
    EXPECT_EQ(maps.dynamic, nullptr);
    // Asked, a frame keeps its image. The first one clears the map, and the others make it in three resolutions, for
    // which the belief needs all rows.
    EXPECT_EQ(layer_.enqueues(), enqueues - (index == 0 ? 2 : 17)) << index;
  }
  const int enqueues = layer_.enqueues(), last = ShortVideo::kFrames - 1;
  layer_.disarm();
  without.enqueue({frames.pixels[last], frames.video.type()}, Motion(), /*done=*/nullptr, /*wants_dynamic=*/true);
  EXPECT_EQ(layer_.enqueues(), enqueues + 3) << "the frame before kept no image";
}

TEST_F(DevicePipelineTest, KeepsNothingOfTheCallers) {
  const ShortVideo video;
  const long before = layer_.references();
  {
    const OwnQueue queue;
    DevicePipeline device = pipeline_on(queue);
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
  DevicePipeline device = pipeline_on(queue);
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

/// Shared virtual memory, until the end of its scope; coarse-grained.
class SvmMemory {
 public:
  SvmMemory(const OwnQueue& queue, std::size_t bytes)
      : queue_(queue), bytes_(bytes), data_(clSVMAlloc(queue.context(), CL_MEM_READ_ONLY, bytes, 0)) {}
  ~SvmMemory() {
    clFinish(queue_.get());
    clSVMFree(queue_.context(), data_);
  }
  SvmMemory(const SvmMemory&) = delete;
  SvmMemory& operator=(const SvmMemory&) = delete;

  const void* get() const { return data_; }
  void write(const ShortVideo& video, int index) {
    clEnqueueSVMMap(queue_.get(), CL_TRUE, CL_MAP_WRITE_INVALIDATE_REGION, data_, bytes_, 0, nullptr, nullptr);
    const std::size_t bytes = view_bytes(video.type());
    for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
      std::memcpy(static_cast<char*>(data_) + view * bytes, video.image(index, view).data, bytes);
    }
    clEnqueueSVMUnmap(queue_.get(), data_, 0, nullptr, nullptr);
  }

 private:
  const OwnQueue& queue_;
  std::size_t bytes_;
  void* data_;
};

bool has_svm(const Device& device) {
  cl_device_svm_capabilities capabilities = 0;
  clGetDeviceInfo(device.handle().device(), CL_DEVICE_SVM_CAPABILITIES, sizeof capabilities, &capabilities, nullptr);
  return capabilities & CL_DEVICE_SVM_COARSE_GRAIN_BUFFER;
}

TEST_F(DevicePipelineTest, SharedVirtualMemoryGivesTheBitsOfTheHostsWay) {
  if (!has_svm(Device::select())) GTEST_SKIP() << "the device has no shared virtual memory";
  for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
    VideoOnDevice frames(type);
    SvmMemory pixels(frames.queue, 2 * view_bytes(type));
    for (int index = 0; index < ShortVideo::kFrames; ++index) {
      pixels.write(frames.video, index);
      const int transfers = layer_.transfers();
      const DeviceMaps maps =
          frames.device.enqueue({.type = type, .svm_pixels = pixels.get()}, frames.video.motion(index),
                                /*done=*/nullptr, /*wants_dynamic=*/true);
      EXPECT_EQ(layer_.transfers(), transfers);
      frames.expect_same(maps, index);
    }
  }
}

TEST_F(DevicePipelineTest, RefusesWhatIsNoSharedVirtualMemory) {
  const OwnQueue queue;
  DevicePipeline device = pipeline_on(queue);
  const std::vector<std::uint8_t> plain(2 * view_bytes(PixelType::kU8));
  const auto expect_not_enqueued = [&](const DeviceImages& images, const std::vector<std::string>& named) {
    layer_.disarm();  // counts from here
    expect_refused([&] { device.enqueue(images, std::nullopt); }, named);
    EXPECT_EQ(layer_.enqueues(), 0);
  };
  layer_.hide_svm(1);
  expect_not_enqueued({.svm_pixels = plain.data()},
                      {Device::select().info().name, "no shared virtual memory", "cl_mem"});
  layer_.hide_svm(0);
  if (!has_svm(Device::select())) GTEST_SKIP() << "the device has no shared virtual memory";
  expect_not_enqueued({.svm_pixels = plain.data()}, {"not what clSVMAlloc returned"});
  const SvmMemory small(queue, plain.size() - 1), enough(queue, plain.size());
  expect_not_enqueued({.svm_pixels = small.get()}, {"fewer bytes than the 15494", "left image, then right image"});
  cl_mem pixels = queue.upload(ShortVideo(), 0);
  expect_not_enqueued({.pixels = pixels, .svm_pixels = enough.get()}, {"give one of them"});
  clReleaseMemObject(pixels);
  EXPECT_TRUE(device.enqueue({.svm_pixels = enough.get()}, std::nullopt).unpredicted.has_value());
}

}  // namespace
}  // namespace egosgm
