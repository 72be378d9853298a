// SPDX-License-Identifier: Apache-2.0
// The same bits wherever a frame is computed: on parts of a device, by programs compiled ahead, without a compiler.
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <thread>

#include "egosgm/error.h"
#include "egosgm/programs.h"
#include "host/method_options.h"
#include "tests/support/expect_refused.h"
#include "tests/support/fault_layer.h"
#include "tests/support/files.h"
#include "tests/support/short_video.h"

namespace egosgm {
namespace {

namespace fs = std::filesystem;
using testing::expect_refused;
using testing::OutputMemory;
using testing::ShortVideo;

TEST(ComputeUnits, GiveTheBitsOfTheWholeDevice) {
  const Device whole = Device::select();
  const int units = whole.info().compute_units;
  if (units < 2) GTEST_SKIP() << "the device has one compute unit";
  const ShortVideo video;
  const std::vector<OutputMemory> expected = video.through(whole);
  std::vector<std::vector<OutputMemory>> actual(3);
  {
    std::vector<std::jthread> threads;  // all at once
    threads.emplace_back([&] { actual[0] = video.through(whole.compute_units(0, 0)); });
    threads.emplace_back([&] { actual[1] = video.through(whole.compute_units(units - 1, units - 1)); });
    threads.emplace_back([&] { actual[2] = video.through(whole.compute_units(0, units - 1)); });
  }
  for (const auto& outputs : actual) EXPECT_TRUE(same_outputs(outputs, expected, ShortVideo::kSize));
}

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
    temporary_ = std::make_unique<TemporaryFolder>();
    folder_ = temporary_->path();
    for (const Scheduling scheduling : {Scheduling::kWavefront, Scheduling::kPaths}) {
      const fs::path folder = folder_ / (scheduling == Scheduling::kPaths ? "paths" : "wavefront");
      fs::create_directory(folder);
      for (const ProgramFile& file : compile_programs(Device::select(), options(scheduling))) {
        write_bytes(folder / file.name, file.bytes);
      }
    }
  }
  static void TearDownTestSuite() { temporary_.reset(); }

  void TearDown() override { layer_.forbid_sources(0); }

  static MethodOptions options(Scheduling scheduling) {
    MethodOptions options = ShortVideo::options();
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
  static inline std::unique_ptr<TemporaryFolder> temporary_;
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
  const MethodOptions chosen = options(Scheduling::kWavefront);
  const std::vector<OutputMemory> expected = video.through(device, chosen);
  layer_.forbid_sources(1);
  const Device part = device.compute_units(1, 1).with_programs(folder_ / "wavefront");
  EXPECT_TRUE(same_outputs(video.through(part, chosen), expected, ShortVideo::kSize));
  const Device same = device.with_programs(folder_ / "wavefront").compute_units(1, 1);
  EXPECT_TRUE(same_outputs(video.through(same, chosen), expected, ShortVideo::kSize));
}

TEST_F(CompiledTest, ProgramsOfAnotherDeviceAreRefused) {
  const std::string manifest = read_bytes(folder_ / "wavefront/manifest.json");
  for (const std::string name : {"device", "device_version", "driver", "platform", "platform_version"}) {
    const fs::path folder = copied();
    const std::string field = '"' + name + "\": \"";
    write_bytes(folder / "manifest.json", replaced(manifest, field, field + "Other "));
    expect_no_pipeline(folder, {"manifest.json: made for " + name + " \"Other ", "here it is", "egosgm compile"});
  }
}

TEST_F(CompiledTest, ProgramsOfOtherSourceOrOptionsAreRefused) {
  fs::path folder = copied();
  const std::string manifest = read_bytes(folder / "manifest.json");
  const std::string field = "\"source_hash\": \"";
  const auto digit = manifest.find(field) + field.size();
  std::string changed = manifest;
  changed[digit] = changed[digit] == '0' ? '1' : '0';
  write_bytes(folder / "manifest.json", changed);
  expect_no_pipeline(folder, {"compiled from another version of the source", "egosgm compile"});

  folder = copied();
  write_bytes(folder / "manifest.json", replaced(manifest, "-DMAX_CHUNKS=4", "-DMAX_CHUNKS=6"));
  expect_no_pipeline(folder, {"has no banded_sgm.cl built with -", "-DMAX_CHUNKS=4", "egosgm compile"});
}

TEST_F(CompiledTest, BrokenFoldersAreRefused) {
  expect_no_pipeline(folder_ / "nowhere", {"nowhere/manifest.json", "egosgm compile"});
  for (const std::string text : {"", "no JSON", "[]", "{}", "{\"format\": 2}", "{\"format\": 1}"}) {
    const fs::path folder = copied();
    write_bytes(folder / "manifest.json", text);
    expect_no_pipeline(folder, {"manifest.json", "egosgm compile"});
  }
  for (const auto& change : std::vector<std::function<void(const fs::path&)>>{
           [](const fs::path& file) { fs::resize_file(file, fs::file_size(file) - 1); },
           [](const fs::path& file) { write_bytes(file, ""); }, [](const fs::path& file) { fs::remove(file); }}) {
    const fs::path folder = copied();
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().filename().string().starts_with("banded_sgm-")) change(entry.path());
    }
    expect_no_pipeline(folder, {"banded_sgm-", ".bin", "egosgm compile"});
  }
}

}  // namespace
}  // namespace egosgm
