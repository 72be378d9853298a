// SPDX-License-Identifier: Apache-2.0
// Nothing is compiled inside a frame: what a driver keeps of what it compiled is there before the first one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include "host/frame/frame_queue.h"
#include "host/tuning_defaults.h"
#include "tests/support/device.h"
#include "tests/support/files.h"
#include "tests/support/pipeline_video.h"

namespace egosgm::testing {
namespace {

namespace fs = std::filesystem;

/// PoCL's cache of this process alone: machine code as it is made.
class Cache {
 public:
  Cache() { ::setenv("POCL_CACHE_DIR", folder_.c_str(), 1); }

  std::set<std::string> files() const {
    std::set<std::string> all;
    for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
      const fs::path kind = entry.path().extension();
      if (kind == ".bc" || kind == ".so") all.insert(fs::relative(entry.path(), folder_).string());
    }
    return all;
  }
  std::vector<std::string> new_since(const std::set<std::string>& before) const {
    std::vector<std::string> added;
    std::ranges::set_difference(files(), before, std::back_inserter(added));
    return added;
  }

 private:
  const TemporaryFolder temporary_;
  const fs::path& folder_ = temporary_.path();
};

const Cache cache;  // before the driver is there

/// Frames of every kind: a first one, one with a prediction, one without a motion, one after a reset.
void play(Pipeline& pipeline, const Video& video, const FrameOutputs& outputs) {
  const auto frame = [&](int index, const std::optional<Motion>& motion) {
    const ImageMemory left = video.image(index, EGOSGM_LEFT), right = video.image(index, EGOSGM_RIGHT);
    pipeline.process(left.view(), right.view(), motion, outputs);
  };
  frame(0, {});
  frame(1, video.motion(1));
  frame(2, {});
  pipeline.reset();
  frame(0, video.motion(1));
  frame(1, video.motion(1));
}

class FirstFrame : public ::testing::TestWithParam<Setting> {};

TEST_P(FirstFrame, CompilesNothing) {
  const Setting& setting = GetParam();
  const Video video(setting, 3);
  Pipeline pipeline(setting.scene().calibration(), setting.size.width, setting.size.height, setting.options,
                    Device::select(), setting.type);
  const std::set<std::string> built = cache.files();
  if (built.empty()) GTEST_SKIP() << "a driver without a cache of its own";
  OutputMemory memory(setting.size);
  FrameOutputs disparities;
  disparities.disparity = memory.disparity.view();
  play(pipeline, video, disparities);
  EXPECT_EQ(cache.new_since(built), std::vector<std::string>());
  pipeline.prepare(setting.type, memory.views());
  const std::set<std::string> prepared = cache.files();
  play(pipeline, video, memory.views());
  EXPECT_EQ(cache.new_since(prepared), std::vector<std::string>());
}

std::vector<Setting> some_settings() {
  std::vector<Setting> some;
  for (const Setting& setting : settings()) {
    if (std::set<std::string>{"standard", "paper", "left_tracked", "along_paths_full_search", "not_temporal"}.contains(
            setting.name)) {
      some.push_back(setting);
    }
  }
  return some;
}

INSTANTIATE_TEST_SUITE_P(Settings, FirstFrame, ::testing::ValuesIn(some_settings()),
                         [](const auto& info) { return info.param.name; });

// Each costs a tenth of a second with nothing in it: those of most kernels, of BandedSgm, and of the coarse images.
TEST(Programs, AreFew) {
  const MethodOptions usual = options(64, 0);
  FrameQueue frames(standard().scene().calibration(), kSize, usual, Device::select(), PixelType::kU8);
  EXPECT_LE(frames.context().builds(), 4);
}

// Of all stages, for both types, as CPUs take pixels: no two files share a name.
TEST(Programs, AreBuiltTogether) {
  for (const bool track_right : {true, false}) {
    for (const PixelType type : {PixelType::kU8, PixelType::kU16}) {
      const MethodOptions all = options(64, 0, [=](MethodOptions& o) {
        o.track_right = track_right;
        o.sad_check.max_difference = 9;
      });
      ocl::Context context(any_device());
      Method method(context, kSize, standard().scene().calibration(), all, with_defaults({}, Device::select().info()));
      method.prepare(type, {Output::kReason});
      context.build();
      EXPECT_LE(context.builds(), 4);
    }
  }
}

}  // namespace
}  // namespace egosgm::testing
