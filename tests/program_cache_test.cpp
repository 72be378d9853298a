// SPDX-License-Identifier: Apache-2.0
// Programs that are kept on the disk: the same bits without a compiler, and no broken file or folder ends the work.
#include "host/ocl/program_cache.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "egosgm/error.h"
#include "tests/support/device.h"
#include "tests/support/fault_layer.h"
#include "tests/support/short_video.h"

namespace egosgm {
namespace {

namespace fs = std::filesystem;
using ocl::ProgramCache;
using testing::OutputMemory;
using testing::ShortVideo;

TEST(ProgramCache, HashesAreThoseOfFnv) {
  EXPECT_EQ(ocl::hash_of(""), "cbf29ce484222325");
  EXPECT_EQ(ocl::hash_of("a"), "af63dc4c8601ec8c");
}

std::string read(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write(const fs::path& file, const std::string& bytes) { std::ofstream(file, std::ios::binary) << bytes; }

/// A small program that is built again and again.
class Program {
 public:
  static ocl::ProgramSource source(int number) {
    return {"f.cl", "kernel void f(global int* a) { a[0] = " + std::to_string(number % 10) + "; }", "-cl-std=CL1.2",
            ""};
  }
  cl::Program built() const { return context_->built(source(0)); }
  /// Whatever is kept.
  cl::Program compiled(int number) const {
    cl::Program program(context_->get(), source(number).text);
    program.build(source(number).options.c_str());
    return program;
  }
  ocl::Context& context() const { return *context_; }

 private:
  std::unique_ptr<ocl::Context> context_ = std::make_unique<ocl::Context>(testing::any_device());
};

/// A folder that pipelines of this process keep their programs in.
class KeptTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::path(::testing::TempDir()) / "egosgm-cache-XXXXXX").string();
    folder_ = fs::path(::mkdtemp(name.data())) / "kept";
    ::setenv("EGOSGM_CACHE", folder_.c_str(), 1);
  }
  void TearDown() override {
    ::unsetenv("EGOSGM_CACHE");
    layer_.forbid_sources(0);
    layer_.disarm();
    fs::remove_all(folder_.parent_path());
  }

  /// By their names.
  std::vector<fs::path> files() const {
    std::error_code none;
    std::set<fs::path> all;
    for (const auto& entry : fs::directory_iterator(folder_, none)) all.insert(entry.path());
    return {all.begin(), all.end()};
  }
  std::vector<OutputMemory> outputs() const { return video_.through(Device::select()); }
  bool builds_without_a_compiler() const {
    layer_.forbid_sources(1);
    bool builds = true;
    try {
      video_.pipeline(Device::select());
    } catch (const DeviceError&) {
      builds = false;
    }
    layer_.forbid_sources(0);
    return builds;
  }
  fs::path aside() const { return folder_ / std::string(32, 'a'); }  // as other stores name what they keep
  void write_aside(const std::string& text) const {
    fs::create_directories(folder_);
    write(aside(), text);
  }
  void expect_same_outputs(const std::vector<OutputMemory>& expected) const {
    EXPECT_TRUE(same_outputs(outputs(), expected, ShortVideo::kSize));
  }

  const testing::FaultLayer layer_{FAULT_LAYER};
  const ShortVideo video_;
  fs::path folder_;
};

TEST_F(KeptTest, ProgramsGiveTheSameBitsWithoutACompiler) {
  const std::vector<OutputMemory> expected = outputs();
  ASSERT_FALSE(files().empty());
  layer_.forbid_sources(1);
  expect_same_outputs(expected);
}

TEST_F(KeptTest, NothingWhereItIsOff) {
  ::setenv("EGOSGM_CACHE", "off", 1);
  outputs();
  EXPECT_TRUE(files().empty());
  EXPECT_FALSE(fs::exists("off"));
}

TEST_F(KeptTest, WhatADeviceSaysGoesBeforeTheVariable) {
  video_.pipeline(Device::select().with_cache("off"));
  EXPECT_TRUE(files().empty());
  EXPECT_FALSE(fs::exists("off"));
  const fs::path other = folder_.parent_path() / "other";
  video_.pipeline(Device::select().with_cache(other.string()));
  EXPECT_TRUE(files().empty());
  EXPECT_FALSE(fs::is_empty(other));
}

TEST_F(KeptTest, WhereNothingIsSaidOnlyForDriversThatKeepNone) {
  const cl::Device device = testing::any_device();
  ::unsetenv("EGOSGM_CACHE");
  if (!Device::select().info().platform.starts_with("Portable"))
    GTEST_SKIP() << "not PoCL, which keeps programs itself";
  EXPECT_FALSE(ProgramCache::of(device));
}

TEST_F(KeptTest, BrokenFilesAreBuiltAnew) {
  video_.pipeline(Device::select());
  const std::vector<fs::path> kept = files();  // before outputs are asked for, which may have programs of their own
  const std::vector<OutputMemory> expected = outputs();
  const std::string whole = read(kept[0]);
  std::string flipped = whole, of_another = whole, longer = whole + '\0';
  flipped.back() ^= 1;
  of_another.replace(of_another.find(kept[0].stem().string()), 16, std::string(16, '0'));
  for (const std::string& broken :
       {std::string(), whole.substr(0, 20), whole.substr(0, 144), whole.substr(0, whole.size() / 2), flipped,
        of_another, longer, std::string("no program")}) {
    write(kept[0], broken);
    EXPECT_FALSE(builds_without_a_compiler()) << broken.size() << " bytes were taken";
    expect_same_outputs(expected);
    EXPECT_EQ(read(kept[0]), whole);
    EXPECT_TRUE(builds_without_a_compiler());
  }
}

// A process that reads it meanwhile has the old one or the new one.
TEST_F(KeptTest, AFileIsReplacedAndNotWrittenInto) {
  outputs();
  const fs::path file = files()[0], other_name = folder_.parent_path() / "read meanwhile";
  const std::string whole = read(file);
  write(file, "old");
  fs::create_hard_link(file, other_name);
  outputs();
  EXPECT_EQ(read(file), whole);
  EXPECT_EQ(read(other_name), "old");
}

// Whole by its header, but nothing that the driver takes.
TEST_F(KeptTest, ABinaryThatTheDriverRefusesIsBuiltAnew) {
  const std::vector<OutputMemory> expected = outputs();
  const fs::path file = files()[0];
  const std::string head = read(file).substr(0, 16 + 16), binary = "no binary of any driver";
  write(file, head + ocl::hash_of(binary) + binary);
  expect_same_outputs(expected);
  EXPECT_TRUE(builds_without_a_compiler());
}

TEST_F(KeptTest, NoFileIsWhatItsNameSays) {
  const std::vector<OutputMemory> expected = outputs();
  const std::vector<fs::path> kept = files();
  ASSERT_GE(kept.size(), 3u);
  fs::remove(kept[0]);
  fs::create_directory(kept[0]);
  fs::rename(kept[1], folder_ / "elsewhere");
  fs::create_symlink(folder_ / "elsewhere", kept[1]);
  fs::remove(kept[2]);
  ASSERT_EQ(::mkfifo(kept[2].c_str(), 0600), 0);  // nobody writes
  expect_same_outputs(expected);
  EXPECT_TRUE(fs::is_directory(kept[0]));
  EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(kept[1])));
  EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(kept[2])));
  for (const fs::path& file : files())
    EXPECT_TRUE(file.extension() == ".egosgm" || file.filename() == "elsewhere") << file;
}

TEST_F(KeptTest, AFolderThatCannotBeMadeEndsNothing) {
  ::setenv("EGOSGM_CACHE", "/proc/no_folder/kept", 1);
  const std::vector<OutputMemory> expected = outputs();
  write(folder_, "a file");
  ::setenv("EGOSGM_CACHE", folder_.c_str(), 1);
  expect_same_outputs(expected);
  EXPECT_EQ(read(folder_), "a file");
}

// The driver's calls that only the folder needs may fail.
TEST_F(KeptTest, FaultsOfItsCallsAreNoErrors) {
  const Program program;
  program.built();
  layer_.arm(-1, 0, testing::FaultLayer::kAtOnce);
  program.built();
  const int calls = layer_.calls();
  ASSERT_GE(calls, 2);
  for (int at = 0; at < calls; ++at) {
    for (const int code : {CL_OUT_OF_RESOURCES, CL_OUT_OF_HOST_MEMORY, CL_INVALID_BINARY}) {
      layer_.arm(at, code, testing::FaultLayer::kAtOnce);
      cl::Program built;
      EXPECT_NO_THROW(built = program.built()) << at;
      layer_.disarm();
      EXPECT_NO_THROW(cl::Kernel(built, "f")) << at;
    }
  }
  // A binary that cannot be had of what was built.
  for (const fs::path& file : files()) fs::remove(file);
  layer_.arm(-1, 0, testing::FaultLayer::kAtOnce);
  program.built();
  for (int at = 2; at < layer_.calls(); ++at) {  // behind the program and its build
    for (const fs::path& file : files()) fs::remove(file);
    layer_.arm(at, CL_OUT_OF_RESOURCES, testing::FaultLayer::kAtOnce);
    EXPECT_NO_THROW(program.built()) << at;
    EXPECT_TRUE(files().empty()) << at;
  }
}

TEST_F(KeptTest, WhatWasUsedLeastLatelyGoes) {
  const Program program;
  const ProgramCache cache(folder_, program.context().device());
  const auto keep = [&](int number, const ProgramCache& where) {
    const cl::Program built = program.compiled(number);
    where.keep(Program::source(number), built);
    return where.file_of(Program::source(number));
  };
  write_aside("a file of the user's");
  for (const int number : {0, 1, 2}) keep(number, cache);
  const std::uintmax_t bytes = fs::file_size(cache.file_of(Program::source(0)));
  const auto hours_ago = [](int hours) { return fs::file_time_type::clock::now() - std::chrono::hours(hours); };
  for (const int number : {0, 1, 2}) fs::last_write_time(cache.file_of(Program::source(number)), hours_ago(9 - number));
  EXPECT_TRUE(cache.built(program.context().get(), program.context().device(), Program::source(0))());  // used now
  const fs::path newest = keep(3, ProgramCache(folder_, program.context().device(), bytes * 5 / 2));
  EXPECT_TRUE(fs::exists(newest));
  EXPECT_TRUE(fs::exists(cache.file_of(Program::source(0))));
  EXPECT_FALSE(fs::exists(cache.file_of(Program::source(1))));
  EXPECT_FALSE(fs::exists(cache.file_of(Program::source(2))));
  keep(4, ProgramCache(folder_, program.context().device(), bytes / 2));
  EXPECT_FALSE(fs::exists(cache.file_of(Program::source(4)))) << "one is larger than all may be";
  EXPECT_TRUE(fs::exists(aside()));
}

TEST_F(KeptTest, EachDifferenceIsAProgramOfItsOwn) {
  const Program program;
  const cl::Device device = program.context().device();
  const ProgramCache cache(folder_, device);
  const ocl::ProgramSource source = Program::source(0);
  ocl::ProgramSource text = source, options = source, moved = source;
  text.text += ' ';
  options.options += ' ';
  moved.options = source.options + source.text.substr(0, 1);
  moved.text = source.text.substr(1);
  ::setenv("CL_CONFIG_CPU_TARGET_ARCH", "another", 1);
  const ProgramCache another(folder_, device);
  ::unsetenv("CL_CONFIG_CPU_TARGET_ARCH");
  const std::set<fs::path> names = {cache.file_of(source), cache.file_of(text), cache.file_of(options),
                                    cache.file_of(moved), another.file_of(source)};
  EXPECT_EQ(names.size(), 5u);
  EXPECT_EQ(ProgramCache(folder_, device).file_of(source), cache.file_of(source));
}

}  // namespace
}  // namespace egosgm
