// SPDX-License-Identifier: Apache-2.0
// Fails every OpenCL call of a frame and of construction in turn. Each must be reported as DeviceError and change
// nothing: the next frame has the bits that it would have had, and nothing leaks.
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <memory>
#include <regex>
#include <tuple>

#include "egosgm/error.h"
#include "egosgm/pipeline.h"
#include "host/method_options.h"
#include "tests/support/fault_layer.h"
#include "tests/support/frame_memory.h"
#include "tests/support/scene.h"

namespace egosgm {
namespace {

using testing::ImageMemory;
using testing::OutputMemory;
using testing::Scene;

constexpr shared::ImageSize kSmall{24, 12};

std::unique_ptr<Pipeline> make_pipeline() {
  static const Device device = Device::select();
  MethodOptions options;
  options.disparities = 16;
  options.sad_check.max_difference = 60;
  options.speckle_removal.max_size_px = 4;
  return std::make_unique<Pipeline>(Scene(kSmall).calibration(), kSmall.width, kSmall.height, options, device);
}

/// A scene's first frames, rendered once.
struct Drive {
  Scene scene;
  std::vector<std::vector<int>> greys;

  explicit Drive(const Scene& of) : scene(of) {
    for (int frame = 0; frame < 6; ++frame) greys.push_back(scene.frame(frame).greys);
  }
  void submit_to(Pipeline& pipeline, int frame, const FrameOutputs& outputs) const {
    const ImageMemory left(scene.size(), greys[frame], EGOSGM_LEFT, PixelType::kU8);
    const ImageMemory right(scene.size(), greys[frame], EGOSGM_RIGHT, PixelType::kU8);
    pipeline.submit(left.view(), right.view(), scene.motion(frame), outputs);
  }
};

/// All that a frame gives.
struct Maps : OutputMemory {
  Maps() : OutputMemory(kSmall) {}
};

void submit(Pipeline& pipeline, int frame, Maps& maps) {
  static const Drive drive{Scene(kSmall)};
  drive.submit_to(pipeline, frame, maps.views());
}

void process(Pipeline& pipeline, int frame, Maps& maps) {
  submit(pipeline, frame, maps);
  pipeline.collect();
}

Maps process(Pipeline& pipeline, int frame) {
  Maps maps;
  process(pipeline, frame, maps);
  return maps;
}

/// The code, whether it comes late, and whether the device has memory of its own.
using Fault = std::tuple<int, bool, bool>;

std::string fault_name(const ::testing::TestParamInfo<Fault>& info) {
  static const std::map<int, std::string> kCodes{{CL_OUT_OF_RESOURCES, "OutOfResources"},
                                                 {CL_OUT_OF_HOST_MEMORY, "OutOfHostMemory"},
                                                 {CL_MEM_OBJECT_ALLOCATION_FAILURE, "MemObjectAllocationFailure"},
                                                 {CL_DEVICE_NOT_AVAILABLE, "DeviceNotAvailable"}};
  const auto& [code, is_late, separate_memory] = info.param;
  return kCodes.at(code) + (is_late ? "Late" : "AtOnce") + (separate_memory ? "SeparateMemory" : "");
}

/// Of the calls that build a pipeline every 23rd fails, others for every code; with EGOSGM_ALL_FAULTS all of them (the
/// lane `faults`).
int stride() { return std::getenv("EGOSGM_ALL_FAULTS") ? 1 : 23; }

class FaultTest : public ::testing::TestWithParam<Fault> {
 protected:
  const testing::FaultLayer faults_{FAULT_LAYER};
  const int code_ = std::get<0>(GetParam());
  const bool is_late_ = std::get<1>(GetParam());

  FaultTest() { faults_.reuse_builds(1); }
  ~FaultTest() override { faults_.reuse_builds(0); }

  /// Calls, or commands, of one run of `f`.
  template <typename F>
  int count(F&& f) {
    faults_.disarm();
    f();
    return is_late_ ? faults_.enqueues() : faults_.calls();
  }

  void arm(int at) const {
    faults_.arm(at, code_, is_late_ ? testing::FaultLayer::kLate : testing::FaultLayer::kAtOnce);
  }

  /// A command that fails late may have lost its status to the event that it waited for, and to nothing else.
  bool tells(const DeviceError& error) const {
    return error.code() == code_ || (is_late_ && error.code() == CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST);
  }

  /// `f` must report that the call `at` failed.
  template <typename F>
  void expect_reported(int at, F&& f) {
    arm(at);
    try {
      f();
      ADD_FAILURE() << "call " << at << " failed and nobody noticed";
    } catch (const DeviceError& error) {
      EXPECT_TRUE(tells(error)) << "call " << at << ": " << error.what();
      EXPECT_TRUE(std::regex_search(error.what(), std::regex("^[A-Za-z]+: .*OpenCL status CL_[A-Z_]+")))
          << error.what();
    } catch (const std::exception& error) {
      ADD_FAILURE() << "call " << at << ": " << typeid(error).name() << " " << error.what();
    }
    faults_.disarm();
  }

  /// Fails each call of frame `frame` of a pipeline that has done `before` frames since its reset.
  void fail_every_call(int before) {
    const long none = faults_.references();
    auto pipeline = make_pipeline();
    process(*pipeline, 0);  // builds what gives reasons
    const auto prepare = [&] {
      pipeline->reset();
      for (int frame = 0; frame < before; ++frame) process(*pipeline, frame);
    };
    prepare();
    Maps expected;
    const int calls = count([&] { expected = process(*pipeline, before); });
    ASSERT_GT(calls, 10);
    const long steady = faults_.references();
    ASSERT_GT(steady, none + 50);
    for (int at = 0; at < calls && !HasFailure(); ++at) {
      prepare();
      Maps failed;
      expect_reported(at, [&] { process(*pipeline, before, failed); });
      EXPECT_EQ(failed, Maps()) << "call " << at << " of " << calls << " failed, outputs were touched";
      EXPECT_EQ(faults_.references(), steady) << "after call " << at << " of " << calls << " failed";
      EXPECT_EQ(process(*pipeline, before), expected) << "after call " << at << " of " << calls << " failed";
    }
    pipeline.reset();
    EXPECT_EQ(faults_.references(), none);
  }
};

TEST_P(FaultTest, EveryCallOfAFrameAfterReset) { fail_every_call(0); }

TEST_P(FaultTest, EveryCallOfASteadyFrame) { fail_every_call(2); }

TEST_P(FaultTest, EveryCallOfTheFirstFrame) {
  const Maps expected = process(*make_pipeline(), 0);
  const auto pipeline = make_pipeline(), other = make_pipeline();
  const int all = count([&] { process(*other, 0); });
  other->reset();
  const int of_frame = count([&] { process(*other, 0); });
  // The calls before build what gives reasons, which is kept where a later one fails.
  const int building = all - of_frame;
  for (int at = 0; at <= building && !HasFailure(); ++at) {
    expect_reported(at, [&] { process(*pipeline, 0); });
  }
  for (int at = 1; at < of_frame && !HasFailure(); ++at) {
    expect_reported(at, [&] { process(*pipeline, 0); });
  }
  EXPECT_EQ(process(*pipeline, 0), expected);
}

TEST_P(FaultTest, EveryCallOfConstruction) {
  const Maps expected = process(*make_pipeline(), 0);  // and what the driver builds once and keeps
  const long before = faults_.references();
  const int calls = count([] { make_pipeline(); });
  ASSERT_GT(calls, is_late_ ? 2 : 500);
  const int offset = -code_;
  const int step = is_late_ ? 1 : stride();  // there are few commands
  for (int at = offset % step; at < calls && !HasFailure(); at += step) {
    expect_reported(at, [] { make_pipeline(); });
    EXPECT_EQ(faults_.references(), before) << "after call " << at << " of " << calls << " failed";
  }
  EXPECT_EQ(process(*make_pipeline(), 0), expected);
  EXPECT_EQ(faults_.references(), before);
}

using ::testing::Bool;
using ::testing::Combine;
using ::testing::Values;
INSTANTIATE_TEST_SUITE_P(Codes, FaultTest,
                         Combine(Values(CL_OUT_OF_RESOURCES, CL_OUT_OF_HOST_MEMORY, CL_MEM_OBJECT_ALLOCATION_FAILURE,
                                        CL_DEVICE_NOT_AVAILABLE),
                                 Bool(), Values(false)),
                         fault_name);

/// Plays frames with two under way, and goes on after errors as the contract of submit and collect says.
class OverlappedRun {
 public:
  /// Frames `first` to `last`; `maps`: one a frame.
  OverlappedRun(Pipeline& pipeline, int first, int last, std::vector<Maps>& maps)
      : pipeline_(pipeline), first_(first), maps_(maps) {
    for (int next = first, oldest = first; oldest <= last;) {
      try {
        while (next <= last && pipeline.under_way() < Pipeline::kMaxUnderWay) {
          submit(pipeline, next, maps[next - first]);
          ++next;
        }
        pipeline.collect();
        ++oldest;
      } catch (const DeviceError&) {
        if (++errors_ > last) {
          ADD_FAILURE() << "frame " << oldest << " fails again and again";
          return;
        }
        if (pipeline.under_way() == 0) next = oldest;
        expect_untouched_from(oldest);
      }
    }
  }

  int errors() const { return errors_; }

 private:
  void expect_untouched_from(int frame) {
    for (std::size_t i = frame - first_; i < maps_.size(); ++i) EXPECT_EQ(maps_[i], Maps()) << "frame " << i;
  }

  Pipeline& pipeline_;
  const int first_;
  std::vector<Maps>& maps_;
  int errors_ = 0;
};

class OverlappedFaultTest : public FaultTest {
 protected:
  OverlappedFaultTest() { faults_.separate_memory(std::get<2>(GetParam())); }
  ~OverlappedFaultTest() override { faults_.separate_memory(false); }
};

TEST_P(OverlappedFaultTest, EveryCallOfTwoFramesUnderWay) {
  constexpr int kFirst = 1, kLast = 3;
  const auto pipeline = make_pipeline();
  faults_.separate_memory(false);
  const auto other = make_pipeline();
  std::vector<Maps> expected;
  process(*other, 0);
  for (int frame = kFirst; frame <= kLast; ++frame) expected.push_back(process(*other, frame));

  const auto play = [&](std::vector<Maps>& maps) { return OverlappedRun(*pipeline, kFirst, kLast, maps).errors(); };
  const auto prepare = [&] {
    pipeline->reset();
    process(*pipeline, 0);
  };
  prepare();
  const int calls = count([&] {
    std::vector<Maps> maps(expected.size());
    EXPECT_EQ(play(maps), 0);
    EXPECT_EQ(maps, expected);
  });
  for (int at = 0; at < calls && !HasFailure(); ++at) {
    prepare();
    std::vector<Maps> maps(expected.size());
    arm(at);
    EXPECT_EQ(play(maps), 1) << "call " << at << " of " << calls;
    faults_.disarm();
    EXPECT_EQ(maps, expected) << "after call " << at << " of " << calls << " failed";
  }
}

// What is known of the rows' offset goes back with the rest; the other tests' images are too small for an estimate.
TEST_P(OverlappedFaultTest, TheVerticalOffsetOfFramesThatFailedIsForgotten) {
  constexpr shared::ImageSize kSize{127, 61};
  const Drive drive(Scene(kSize, 0, 0.4));
  MethodOptions options;
  options.disparities = 32;
  Pipeline pipeline(drive.scene.calibration(), kSize.width, kSize.height, options);
  const auto submit_frame = [&](int index) { drive.submit_to(pipeline, index, {}); };
  std::vector<double> expected;
  for (int index = 0; index < 4; ++index) {
    submit_frame(index);
    expected.push_back(pipeline.collect().vertical_offset_px);
  }
  EXPECT_NE(expected[2], expected[3]);

  pipeline.reset();
  const int calls = count([&] { submit_frame(0), pipeline.collect(); });
  submit_frame(1);
  arm(calls / 4);
  const auto frame_that_fails = [&] {
    submit_frame(2);
    faults_.disarm();
    pipeline.collect();
  };
  EXPECT_THROW(frame_that_fails(), DeviceError);
  faults_.disarm();
  for (int index = pipeline.under_way() == 0 ? 1 : 2; index < 4; ++index) {
    submit_frame(index);
    if (pipeline.under_way() == 2) pipeline.collect();
    EXPECT_EQ(pipeline.collect().vertical_offset_px, expected[index]) << "frame " << index;
  }
}

// The frames under way may still write into memory of the pipeline.
TEST_P(OverlappedFaultTest, APipelineMayEndWithFramesUnderWay) {
  const long before = faults_.references();
  const int calls = count([&] {
    const auto pipeline = make_pipeline();
    Maps maps[2];
    submit(*pipeline, 0, maps[0]);
    submit(*pipeline, 1, maps[1]);
  });
  EXPECT_GT(calls, 10);
  EXPECT_EQ(faults_.references(), before);
}

INSTANTIATE_TEST_SUITE_P(Codes, OverlappedFaultTest, Combine(Values(CL_OUT_OF_RESOURCES), Bool(), Bool()), fault_name);

TEST(Destruction, IsQuietWhicheverReleaseFails) {
  const testing::FaultLayer layer(FAULT_LAYER);
  layer.reuse_builds(1);
  const Maps expected = process(*make_pipeline(), 0);
  const long before = layer.references();
  const auto destroy_after_a_frame = [&](int failing) {
    auto pipeline = make_pipeline();
    process(*pipeline, 0);
    layer.arm(failing, CL_OUT_OF_HOST_MEMORY, testing::FaultLayer::kRelease);
    pipeline.reset();
    const int releases = layer.releases();
    layer.disarm();
    return releases;
  };
  const int releases = destroy_after_a_frame(-1);
  ASSERT_GT(releases, 50);
  for (int at = 0; at < releases; at += stride()) {
    EXPECT_EQ(destroy_after_a_frame(at), releases);
    EXPECT_EQ(layer.references(), before) << "release " << at << " of " << releases << " failed";
  }
  layer.reuse_builds(0);
  EXPECT_EQ(process(*make_pipeline(), 0), expected);
}

// A driver may begin a queue's commands only when it is flushed, or somebody waits: then frames would not overlap.
TEST(Queues, AllThatWasSubmittedBeginsBeforeAnybodyWaits) {
  const testing::FaultLayer layer(FAULT_LAYER);
  for (const int separate : {0, 1}) {
    layer.separate_memory(separate);
    const auto pipeline = make_pipeline();
    layer.separate_memory(0);
    std::vector<Maps> expected(4), maps(4);
    OverlappedRun(*pipeline, 0, 3, expected);
    pipeline->reset();
    layer.batch(1);
    OverlappedRun(*pipeline, 0, 3, maps);
    EXPECT_EQ(layer.begun_by_wait(), 0) << "memory of its own: " << separate;
    layer.batch(0);
    EXPECT_EQ(maps, expected);
  }
}

TEST(Memory, NoBufferIsMadeInAFrame) {
  const testing::FaultLayer layer(FAULT_LAYER);
  const auto pipeline = make_pipeline();
  const long made = layer.buffers_created();
  for (int frame = 0; frame < 3; ++frame) process(*pipeline, frame);
  std::vector<Maps> maps(3);
  OverlappedRun(*pipeline, 3, 5, maps);
  EXPECT_EQ(layer.buffers_created(), made);
  const auto bytes = pipeline->device_memory_bytes();
  EXPECT_GT(bytes, 0u);
}

}  // namespace
}  // namespace egosgm
