// SPDX-License-Identifier: Apache-2.0
#include "host/method/method.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "host/frame/frame_transfer.h"
#include "host/tuning_defaults.h"
#include "tests/reference/present_rows.h"
#include "tests/support/device.h"
#include "tests/support/pipeline_video.h"

namespace egosgm::testing {
namespace {

/// A method with what it has built.
struct Built {
  explicit Built(const std::function<void(MethodOptions&)>& change = {})
      : method(context, kSize, standard().scene().calibration(), options(32, 0, change),
               with_defaults({}, Device::select().info())) {
    method.prepare(PixelType::kU8);
    context.build();
  }

  bool has(const std::string& file, const std::string& define = "") const {
    const auto sources = context.sources();
    return std::any_of(sources.begin(), sources.end(), [&](const ocl::ProgramSource& source) {
      return source.kernel_file == file && source.options.find(define) != std::string::npos;
    });
  }

  ocl::Context context{any_device()};
  Method method;
};

TEST(Method, BuildsWhatItsOptionsNeed) {
  EXPECT_FALSE(Built().has("sad_check.cl"));
  EXPECT_TRUE(Built([](auto& o) { o.sad_check.max_difference = 9; }).has("sad_check.cl"));
  Built asked;
  EXPECT_FALSE(asked.has("dynamic_map.cl"));
  asked.method.prepare(PixelType::kU8, {Output::kDynamic});
  EXPECT_TRUE(asked.has("dynamic_map.cl"));
  for (const char* file : {"right_map.cl", "read_off.cl"}) {
    EXPECT_FALSE(Built([](auto& o) { o.coarse_match.enabled = false; }).has(file)) << file;
    EXPECT_TRUE(Built([](auto& o) { o.track_right = o.coarse_match.enabled = false; }).has(file)) << file;
  }
  EXPECT_TRUE(Built().has("read_off.cl"));
  const Built paper([](auto& o) { o = MethodOptions(PipelineOptions::paper()); });
  EXPECT_TRUE(paper.has("sad_check.cl"));
  for (const char* file : {"coarse_match.cl", "median_filter.cl", "vertical_alignment.cl", "weighted_median.cl"}) {
    EXPECT_FALSE(paper.has(file)) << file;
  }
  Built alone([](auto& o) { o.temporal = false; });
  alone.method.prepare(PixelType::kU8, {Output::kDynamic});
  for (const char* file : {"dynamic_map.cl", "forward_warp.cl", "hole_fill.cl"}) {
    EXPECT_FALSE(alone.has(file)) << file;
  }
  const Built matcher([](auto& o) { o.temporal = o.evidence.enabled = false; });
  for (const char* file : {"kalman_update.cl", "coarse_match.cl"}) {
    EXPECT_TRUE(alone.has(file)) << file;
    EXPECT_FALSE(matcher.has(file)) << file;
  }
}

TEST(Method, BuildsForOneTypeOfImageAndForTheOtherWhenItIsAskedTo) {
  Built built;
  for (const char* file : {"vertical_alignment.cl", "coarse_match.cl"}) {
    EXPECT_TRUE(built.has(file, "PIXEL_BYTES=1")) << file;
    EXPECT_FALSE(built.has(file, "PIXEL_BYTES=2")) << file;
  }
  const std::size_t bytes = built.context.allocated_bytes();
  built.method.prepare(PixelType::kU16);
  for (const char* file : {"vertical_alignment.cl", "coarse_match.cl"}) {
    EXPECT_TRUE(built.has(file, "PIXEL_BYTES=2")) << file;
  }
  EXPECT_EQ(built.context.allocated_bytes(), bytes) << "memory is all allocated at first";
}

TEST(Method, BuildsNothingInAFrame) {
  Built built;
  const Video video(standard(), 3);
  FrameTransfer transfer(built.context, kSize, {0, 32});
  Belief before(built.context, kSize), after(built.context, kSize);
  const Wanted wanted{Output::kRightDisparity, Output::kRightVariance, Output::kDynamic};
  built.method.prepare(PixelType::kU8, wanted);
  built.context.build();
  const int builds = built.context.builds();
  for (int index = 0; index < video.size(); ++index) {
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    const Plan plan = plan_of(options(32, 0), before.why_not, before.offset.is_known, video.motion(index), wanted);
    built.method.frame(plan, transfer.upload(left.view(), right.view()), before, after, transfer.output());
    built.context.wait();
    std::swap(before, after);
  }
  EXPECT_EQ(built.context.builds(), builds);
}

// A belief is a value: a frame leaves the one before it as it was, and may be run on it again.
TEST(Method, AFrameLeavesTheBeliefBeforeItAsItWas) {
  Built built;
  const Video video(standard(), 2);
  FrameTransfer transfer(built.context, kSize, {0, 32});
  Belief first(built.context, kSize), second(built.context, kSize), nothing(built.context, kSize);
  const auto frame = [&](int index, const Belief& before, Belief& after) {
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    const Plan plan = plan_of(options(32, 0), before.why_not, before.offset.is_known, video.motion(index), {});
    built.method.frame(plan, transfer.upload(left.view(), right.view()), before, after, transfer.output());
    built.context.wait();
  };
  frame(0, nothing, first);
  const std::vector<float> disparity = first.maps.disparity.read(built.context);
  const std::vector<float> variance = first.maps.variance.read(built.context);
  const std::vector<float> terms = first.offset.terms.read(built.context);
  frame(1, first, second);
  const auto of_second = [&] {  // absent rows hold anything
    const HostMaps maps = masked({second.maps.disparity.read(built.context), second.maps.variance.read(built.context)});
    return reference::without_absent_rows(kSize, options(32, 0).banded_sgm.row_step, maps);
  };
  const HostMaps once = of_second();
  EXPECT_EQ(first.maps.disparity.read(built.context), disparity);
  EXPECT_EQ(first.maps.variance.read(built.context), variance);
  EXPECT_EQ(first.offset.terms.read(built.context), terms);
  frame(1, first, second);
  EXPECT_TRUE(same_maps(of_second(), once, kSize));
}

}  // namespace
}  // namespace egosgm::testing
