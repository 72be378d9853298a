// SPDX-License-Identifier: Apache-2.0
// Who gets which sequence of a batch when devices fail, and how counters of energy are read.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

#include "apps/batch_queue.h"
#include "apps/energy_meter.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

TEST(BatchQueue, DealsOutJobsInOrder) {
  BatchQueue queue(3, 2);
  EXPECT_EQ(queue.next(0), 0);
  EXPECT_EQ(queue.next(1), 1);
  queue.succeeded(0);
  EXPECT_EQ(queue.next(0), 2);
  queue.succeeded(2);
  queue.succeeded(1);
  EXPECT_EQ(queue.next(0), std::nullopt);
  EXPECT_EQ(queue.next(1), std::nullopt);
}

TEST(BatchQueue, ADeviceThatFailedWhereAnotherDidNotGetsNoMore) {
  BatchQueue queue(3, 2);
  ASSERT_EQ(queue.next(0), 0);
  EXPECT_TRUE(queue.hand_over(0, 0));
  EXPECT_EQ(queue.next(0), 1) << "not yet known who is to blame, and not the same again";
  EXPECT_EQ(queue.next(1), 0);
  queue.succeeded(0);
  EXPECT_TRUE(queue.is_retired(0));
  EXPECT_TRUE(queue.hand_over(1, 0));
  EXPECT_EQ(queue.next(0), std::nullopt);
  EXPECT_EQ(queue.next(1), 1) << "what was handed over comes first";
  EXPECT_FALSE(queue.is_retired(1));
}

TEST(BatchQueue, AJobThatFailsEverywhereIsToBlame) {
  BatchQueue queue(2, 2);
  ASSERT_EQ(queue.next(0), 0);
  EXPECT_TRUE(queue.hand_over(0, 0));
  ASSERT_EQ(queue.next(1), 0);
  EXPECT_FALSE(queue.hand_over(0, 1));
  EXPECT_FALSE(queue.is_retired(0));
  EXPECT_FALSE(queue.is_retired(1));
  EXPECT_EQ(queue.next(0), 1);
}

TEST(BatchQueue, OnlyDevicesStillInUseCountAsAnother) {
  BatchQueue queue(3, 2);
  ASSERT_EQ(queue.next(0), 0);
  ASSERT_TRUE(queue.hand_over(0, 0));
  ASSERT_EQ(queue.next(1), 0);
  queue.succeeded(0);  // device 0 is out
  ASSERT_EQ(queue.next(1), 1);
  EXPECT_FALSE(queue.hand_over(1, 1));
  EXPECT_EQ(queue.next(1), 2);
}

TEST(BatchQueue, AnIdleDeviceWaitsForWhatMayBeHandedOver) {
  BatchQueue queue(1, 2);
  ASSERT_EQ(queue.next(0), 0);
  auto second = std::async(std::launch::async, [&] { return queue.next(1); });
  EXPECT_EQ(second.wait_for(std::chrono::milliseconds(20)), std::future_status::timeout);
  queue.hand_over(0, 0);
  EXPECT_EQ(second.get(), 0);
  queue.succeeded(0);
}

TEST(BatchQueue, WaitersLeaveWhenTheLastJobEndsOrItIsStopped) {
  for (const bool stops : {false, true}) {
    BatchQueue queue(1, 2);
    ASSERT_EQ(queue.next(0), 0);
    auto second = std::async(std::launch::async, [&] { return queue.next(1); });
    if (stops) {
      queue.stop();
    } else {
      queue.failed();
    }
    EXPECT_EQ(second.get(), std::nullopt);
  }
}

class EnergyMeterTest : public ::testing::Test {
 protected:
  EnergyMeterTest() { fs::create_directories(folder_); }
  ~EnergyMeterTest() override { fs::remove_all(folder_); }

  void set(const std::string& zone, const std::string& energy_uj, const std::string& range_uj = "1000000") {
    fs::create_directories(folder_ / zone);
    std::ofstream(folder_ / zone / "energy_uj") << energy_uj << '\n';
    std::ofstream(folder_ / zone / "max_energy_range_uj") << range_uj << '\n';
  }

  const fs::path folder_ = fs::path(::testing::TempDir()) / ("egosgm_powercap_" + std::to_string(getpid()));
};

TEST_F(EnergyMeterTest, AddsUpThePackagesAcrossTurnsOfTheirCounters) {
  set("intel-rapl:0", "400000");
  set("intel-rapl:1", "999000");
  set("intel-rapl:0:0", "0");  // cores of package 0, counted with it
  set("intel-rapl", "0");
  EnergyMeter meter(folder_);
  EXPECT_EQ(meter.cpu_joules(), 0.0);
  set("intel-rapl:0", "900000");
  set("intel-rapl:1", "1000");  // 2000 further
  set("intel-rapl:0:0", "777777");
  meter.sample();
  EXPECT_NEAR(*meter.cpu_joules(), 0.502, 1e-9);
  set("intel-rapl:0", "100000");
  meter.sample();
  EXPECT_NEAR(*meter.cpu_joules(), 0.702, 1e-9);
}

TEST_F(EnergyMeterTest, TellsNothingWhereNothingCanBeRead) {
  EXPECT_EQ(EnergyMeter(folder_ / "nowhere").cpu_joules(), std::nullopt);
  set("intel-rapl:0", "not a number");
  EXPECT_EQ(EnergyMeter(folder_).cpu_joules(), std::nullopt);
}

}  // namespace
}  // namespace egosgm::app
