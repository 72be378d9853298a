// SPDX-License-Identifier: Apache-2.0
// Processes that begin in several threads, and processes that were forked. This program's own process never uses
// OpenCL.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "egosgm/error.h"
#include "host/ocl/own_process.h"
#include "tests/support/short_video.h"

namespace egosgm::testing {
namespace {

constexpr int kThreads = 3;
/// That make pipelines, one after the other: 50 in the lane `load`.
int processes() {
  const char* const text = std::getenv("EGOSGM_PROCESSES");
  return text ? std::stoi(text) : 5;
}

/// What waitpid says of a process that does `work`: 0 where that returned true.
int status_of(const std::function<bool()>& work) {
  const pid_t child = ::fork();
  if (child == 0) {
    int code = 1;
    try {
      code = work() ? 0 : 1;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
    }
    ::_exit(code);
  }
  int status = -1;
  ::waitpid(child, &status, 0);
  return status;
}

/// Whether `work` returned true in each of several threads, which begin as one.
bool in_threads(const std::function<bool()>& work) {
  std::atomic<int> ready{0}, succeeded{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i) {
    threads.emplace_back([&] {
      for (++ready; ready < kThreads;) std::this_thread::yield();
      succeeded += work() ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  return succeeded == kThreads;
}

TEST(BeginInThreads, ListDevices) {
  for (int process = 0; process < 50; ++process) {
    ASSERT_EQ(status_of([] { return in_threads([] { return !Device::list().empty(); }); }), 0) << process;
  }
}

TEST(BeginInThreads, GiveTheBitsOfOneThread) {
  const ShortVideo video;
  ASSERT_EQ(status_of([&] { return !video.through(Device::select()).empty(); }), 0);  // fills the driver's cache
  const auto give_the_same = [&] {
    std::atomic<int> threads{0};
    std::vector<std::vector<OutputMemory>> outputs(kThreads);
    const auto through_a_pipeline = [&] {
      outputs[threads++] = video.through(Device::select());
      return true;
    };
    return in_threads(through_a_pipeline) &&
           std::all_of(outputs.begin(), outputs.end(), [&](const std::vector<OutputMemory>& frames) {
             return bool(same_outputs(frames, outputs[0], ShortVideo::kSize));
           });
  };
  for (int process = 0; process < processes(); ++process) ASSERT_EQ(status_of(give_the_same), 0) << process;
}

/// Whether `call` throws the error of a forked process, with its remedy.
template <typename Call>
bool tells_of_fork(Call&& call) {
  try {
    call();
  } catch (const DeviceError& error) {
    return std::string(error.what()).find("spawn") != std::string::npos;
  }
  return false;
}

TEST(Forked, TellsInPlaceOfWaiting) {
  const ShortVideo video;
  const auto parent = [&] {
    std::optional<Pipeline> pipeline = video.pipeline(Device::select());
    OutputMemory memory(ShortVideo::kSize);
    const auto submit = [&] {
      pipeline->submit(video.image(0, EGOSGM_LEFT), video.image(0, EGOSGM_RIGHT), {}, memory.views());
    };
    submit();
    const int forked = status_of([&] {
      const bool all = tells_of_fork([] { Device::list(); }) && tells_of_fork([] { Device::select(); }) &&
                       tells_of_fork([&] { pipeline->device().compute_units(0, 0); }) &&
                       tells_of_fork([&] { video.pipeline(pipeline->device()); }) && tells_of_fork(submit) &&
                       tells_of_fork([&] { pipeline->collect(); }) &&
                       tells_of_fork([&] { pipeline->prepare(video.type(), memory.views()); });
      pipeline.reset();  // waits for nothing
      return all;
    });
    pipeline->collect();  // the parent goes on
    return forked == 0;
  };
  EXPECT_EQ(status_of(parent), 0);
}

TEST(Forked, BeforeTheFirstUseWorks) {
  const ShortVideo video;
  EXPECT_EQ(status_of([&] { return !video.through(Device::select()).empty(); }), 0);
  EXPECT_EQ(status_of([&] { return !video.through(Device::select()).empty(); }), 0);
}

}  // namespace
}  // namespace egosgm::testing
