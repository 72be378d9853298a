// SPDX-License-Identifier: Apache-2.0
// Fails every OpenCL call of a frame and of construction in turn. Each must be reported as DeviceError and change
// nothing: the next frame has the bits that it would have had, and nothing leaks.
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "tests/support/fault_layer.h"

namespace egosgm {
namespace {

constexpr int kWidth = 24, kHeight = 12;
constexpr float kUntouched = 12345.0f;

PipelineOptions small_options() {
  PipelineOptions options;
  options.disparities = 16;
  options.sad_check.max_difference = 60;
  options.speckle_removal.max_size_px = 4;
  return options;
}

/// A textured pair whose scene moves a little from frame to frame.
struct Images {
  std::vector<std::uint8_t> left, right;

  explicit Images(int frame) : left(kWidth * kHeight), right(kWidth * kHeight) {
    std::mt19937 random(71);
    std::vector<std::uint8_t> texture(2 * kWidth * kHeight);
    for (auto& grey : texture) grey = static_cast<std::uint8_t>(random());
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        left[y * kWidth + x] = texture[(y * 2 * kWidth) + x + frame];
        right[y * kWidth + x] = texture[(y * 2 * kWidth) + x + frame + 4];
      }
    }
  }
};

/// All that a frame gives.
struct Maps {
  std::vector<std::vector<float>> maps{8, std::vector<float>(kWidth* kHeight, kUntouched)};
  std::vector<std::uint16_t> search_width = std::vector<std::uint16_t>(kWidth * kHeight, 7);

  bool operator==(const Maps&) const = default;

  FrameOutputs views() {
    const auto view = [&](int i) { return MapView<float>{maps[i].data(), kWidth, kHeight, kWidth * sizeof(float)}; };
    return {view(0), view(1), view(2),
            view(3), view(4), view(5),
            view(6), view(7), {search_width.data(), kWidth, kHeight, kWidth * sizeof(std::uint16_t)}};
  }
};

std::unique_ptr<Pipeline> make_pipeline() {
  static const Device device = Device::select();
  return std::make_unique<Pipeline>(Calibration{.fx = 20, .fy = 20, .cx = 12, .cy = 6, .baseline_m = 0.5}, kWidth,
                                    kHeight, small_options(), device);
}

void process(Pipeline& pipeline, int frame, Maps& maps) {
  const Images images(frame);
  const ImageView left{images.left.data(), kWidth, kHeight, kWidth, PixelType::kU8};
  const ImageView right{images.right.data(), kWidth, kHeight, kWidth, PixelType::kU8};
  Motion motion;
  motion.current_from_previous.translation().z() = -0.01;
  pipeline.process(left, right, motion, maps.views());
}

Maps process(Pipeline& pipeline, int frame) {
  Maps maps;
  process(pipeline, frame, maps);
  return maps;
}

struct Fault {
  int code;
  bool is_late;
};

std::string fault_name(const ::testing::TestParamInfo<Fault>& info) {
  const int code = info.param.code;
  return std::string(code == CL_OUT_OF_RESOURCES                ? "OutOfResources"
                     : code == CL_OUT_OF_HOST_MEMORY            ? "OutOfHostMemory"
                     : code == CL_MEM_OBJECT_ALLOCATION_FAILURE ? "MemObjectAllocationFailure"
                                                                : "DeviceNotAvailable") +
         (info.param.is_late ? "Late" : "AtOnce");
}

class FaultTest : public ::testing::TestWithParam<Fault> {
 protected:
  const testing::FaultLayer faults_{FAULT_LAYER};

  /// Calls, or commands, of one run of `f`.
  template <typename F>
  int count(F&& f) {
    faults_.disarm();
    f();
    return GetParam().is_late ? faults_.enqueues() : faults_.calls();
  }

  /// `f` must report that the call `at` failed.
  template <typename F>
  void expect_reported(int at, F&& f) {
    faults_.arm(at, GetParam().code, GetParam().is_late);
    try {
      f();
      ADD_FAILURE() << "call " << at << " failed and nobody noticed";
    } catch (const DeviceError& error) {
      EXPECT_TRUE(GetParam().is_late || error.code() == GetParam().code) << "call " << at << ": " << error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << "call " << at << ": " << typeid(error).name() << " " << error.what();
    }
    faults_.disarm();
  }

  /// Fails each call of frame `frame` of a pipeline that has done `before` frames since its reset.
  void fail_every_call(int before) {
    const auto pipeline = make_pipeline();
    const auto prepare = [&] {
      pipeline->reset();
      for (int frame = 0; frame < before; ++frame) process(*pipeline, frame);
    };
    prepare();
    Maps expected;
    const int calls = count([&] { expected = process(*pipeline, before); });
    ASSERT_GT(calls, 10);
    for (int at = 0; at < calls && !HasFailure(); ++at) {
      prepare();
      Maps failed;
      expect_reported(at, [&] { process(*pipeline, before, failed); });
      EXPECT_EQ(failed, Maps()) << "call " << at << " of " << calls << " failed, outputs were touched";
      EXPECT_EQ(process(*pipeline, before), expected) << "after call " << at << " of " << calls << " failed";
    }
  }
};

TEST_P(FaultTest, EveryCallOfAFrameAfterReset) { fail_every_call(0); }

TEST_P(FaultTest, EveryCallOfASteadyFrame) { fail_every_call(2); }

TEST_P(FaultTest, EveryCallOfTheFirstFrame) {
  const Maps expected = process(*make_pipeline(), 0);
  const auto pipeline = make_pipeline();
  int calls = 0;
  {
    const auto other = make_pipeline();
    calls = count([&] { process(*other, 0); });
  }
  for (int at = 0; at < calls && !HasFailure(); ++at) {
    expect_reported(at, [&] { process(*pipeline, 0); });
  }
  EXPECT_EQ(process(*pipeline, 0), expected);
}

TEST_P(FaultTest, NothingLeaksFromFailedFrames) {
  const long before = faults_.references();
  {
    const auto pipeline = make_pipeline();
    process(*pipeline, 0);
    const int calls = count([&] { process(*pipeline, 1); });
    const long steady = faults_.references();
    for (int at = 0; at < calls; at += 3) {
      expect_reported(at, [&] { process(*pipeline, 1); });
      ASSERT_EQ(faults_.references(), steady) << "after call " << at << " failed";
    }
  }
  EXPECT_EQ(faults_.references(), before);
}

INSTANTIATE_TEST_SUITE_P(Codes, FaultTest,
                         ::testing::Values(Fault{CL_OUT_OF_RESOURCES, false}, Fault{CL_OUT_OF_HOST_MEMORY, false},
                                           Fault{CL_MEM_OBJECT_ALLOCATION_FAILURE, false},
                                           Fault{CL_DEVICE_NOT_AVAILABLE, false}, Fault{CL_OUT_OF_RESOURCES, true},
                                           Fault{CL_OUT_OF_HOST_MEMORY, true},
                                           Fault{CL_MEM_OBJECT_ALLOCATION_FAILURE, true},
                                           Fault{CL_DEVICE_NOT_AVAILABLE, true}),
                         fault_name);

class ConstructionFaultTest : public FaultTest {};

TEST_P(ConstructionFaultTest, EveryCallOfConstruction) {
  make_pipeline();  // what the driver builds once and keeps
  const long before = faults_.references();
  const int calls = count([] { make_pipeline(); });
  ASSERT_GT(calls, 50);
  for (int at = 0; at < calls && !HasFailure(); ++at) {
    expect_reported(at, [] { make_pipeline(); });
    EXPECT_EQ(faults_.references(), before) << "after call " << at << " of " << calls << " failed";
  }
  EXPECT_NO_THROW(process(*make_pipeline(), 0));
}

INSTANTIATE_TEST_SUITE_P(Codes, ConstructionFaultTest, ::testing::Values(Fault{CL_OUT_OF_RESOURCES, false}),
                         fault_name);

TEST(Memory, NoBufferIsMadeInAFrame) {
  const testing::FaultLayer layer(FAULT_LAYER);
  const auto pipeline = make_pipeline();
  const long made = layer.buffers_created();
  for (int frame = 0; frame < 3; ++frame) process(*pipeline, frame);
  EXPECT_EQ(layer.buffers_created(), made);
  const auto bytes = pipeline->device_memory_bytes();
  EXPECT_GT(bytes, 0u);
}

TEST(Memory, APipelineGivesBackAllThatItTook) {
  const testing::FaultLayer layer(FAULT_LAYER);
  const long before = layer.references();
  {
    const auto pipeline = make_pipeline();
    EXPECT_GT(layer.references(), before + 50);
    const long idle = layer.references();
    for (int frame = 0; frame < 3; ++frame) process(*pipeline, frame);
    EXPECT_EQ(layer.references(), idle) << "a frame keeps something";
  }
  EXPECT_EQ(layer.references(), before);
}

}  // namespace
}  // namespace egosgm
