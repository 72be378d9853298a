// SPDX-License-Identifier: Apache-2.0
#include "egosgm/device.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include "tests/support/expect_refused.h"

namespace egosgm {
namespace {

using testing::expect_refused;

/// EGOSGM_DEVICE as the test wants it, and as it was when the test is over.
class DeviceTest : public ::testing::Test {
 protected:
  DeviceTest() {
    if (const char* value = std::getenv(kName)) before_ = value;
    unsetenv(kName);
  }
  ~DeviceTest() override {
    if (before_) {
      setenv(kName, before_->c_str(), 1);
    } else {
      unsetenv(kName);
    }
  }
  static void set_wanted(const std::string& value) { setenv(kName, value.c_str(), 1); }

 private:
  static constexpr const char* kName = "EGOSGM_DEVICE";
  std::optional<std::string> before_;
};

bool is_same(const Device& a, const Device& b) {
  return a.info().name == b.info().name && a.info().platform == b.info().platform &&
         a.info().version == b.info().version;
}

std::string changed_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::isupper(c) ? std::tolower(c) : std::toupper(c));
  return text;
}

TEST_F(DeviceTest, ListsThemWithWhatTheySayOfThemselves) {
  const std::vector<Device> devices = Device::list();
  ASSERT_FALSE(devices.empty());
  for (const Device& device : devices) {
    const DeviceInfo& info = device.info();
    for (const std::string& text : {info.name, info.vendor, info.platform, info.version, info.driver}) {
      EXPECT_FALSE(text.empty());
      EXPECT_EQ(text.find('\0'), std::string::npos);
    }
    EXPECT_TRUE(info.version.starts_with("OpenCL ")) << info.version;
    EXPECT_GT(info.compute_units, 0);
    EXPECT_GT(info.memory_bytes, 1u << 20);
    EXPECT_GT(info.max_allocation_bytes, 1u << 20);
    EXPECT_LE(info.max_allocation_bytes, info.memory_bytes);
    const bool divides = std::count(info.lacks.begin(), info.lacks.end(), "division into compute units") == 0;
    if (divides) {
      EXPECT_NO_THROW(device.compute_units(0, 0));
    } else {
      EXPECT_THROW(device.compute_units(0, 0), InvalidArgument);
    }
  }
  EXPECT_TRUE(std::is_sorted(devices.begin(), devices.end(),
                             [](const Device& a, const Device& b) { return a.info().type < b.info().type; }));
}

TEST_F(DeviceTest, TakesTheFirstByDefault) {
  Device first = Device::select();
  EXPECT_TRUE(is_same(first, Device::list().front()));
  const Device moved = std::move(first);
  EXPECT_TRUE(is_same(first, moved));  // NOLINT(bugprone-use-after-move): device.h allows it
  set_wanted("");
  EXPECT_TRUE(is_same(Device::select(), Device::list().front()));
}

TEST_F(DeviceTest, IsSelectedByIndex) {
  const std::vector<Device> devices = Device::list();
  for (std::size_t i = 0; i < devices.size(); ++i) {
    EXPECT_TRUE(is_same(Device::select(std::to_string(i)), devices[i])) << i;
  }
}

TEST_F(DeviceTest, IsSelectedByType) {
  const std::pair<DeviceType, std::string> types[] = {
      {DeviceType::kGpu, "GPU"}, {DeviceType::kAccelerator, "accelerator"}, {DeviceType::kCpu, "CPU"}};
  for (const auto& [type, name] : types) {
    EXPECT_EQ(to_string(type), name);
    const std::vector<Device> devices = Device::list();
    const auto first =
        std::find_if(devices.begin(), devices.end(), [&](const Device& device) { return device.info().type == type; });
    for (const std::string& wanted : {name, changed_case(name)}) {
      if (first != devices.end()) {
        EXPECT_TRUE(is_same(Device::select(wanted), *first)) << wanted;
      } else {
        expect_refused([&] { Device::select(wanted); }, {"no OpenCL device fits"});
      }
    }
  }
}

TEST_F(DeviceTest, IsSelectedByAPartOfItsNameVendorOrPlatform) {
  const std::vector<Device> devices = Device::list();
  const DeviceInfo& info = devices.front().info();
  for (const std::string& text : {info.name, info.vendor, info.platform}) {
    EXPECT_TRUE(is_same(Device::select(text), devices.front())) << text;
    EXPECT_TRUE(is_same(Device::select(changed_case(text)), devices.front())) << text;
    const std::string part = text.substr(text.size() / 4, std::max<std::size_t>(3, text.size() / 2));
    EXPECT_NO_THROW(Device::select(part)) << part;
  }
}

TEST_F(DeviceTest, ANumberIsAnIndexAndNeverAPartOfAName) {
  const std::vector<Device> devices = Device::list();
  const std::string there =
      (devices.size() == 1 ? "is 1" : "are " + std::to_string(devices.size())) + std::string(", numbered from 0");
  std::vector<std::string> numbers{std::to_string(devices.size()), "4711", "99999999999999999999"};
  for (const Device& device : devices) {  // the digits in their names
    const std::string text = device.info().name + " " + device.info().vendor + " " + device.info().platform;
    for (std::size_t i = 0; i < text.size(); ++i) {
      for (std::size_t length = 1; length <= 3 && i + length <= text.size(); ++length) {
        const std::string part = text.substr(i, length);
        const bool is_number = part.find_first_not_of("0123456789") == std::string::npos;
        if (is_number && std::stoul(part) >= devices.size()) numbers.push_back(part);
      }
    }
  }
  for (const std::string& number : numbers) {
    expect_refused([&] { Device::select(number); },
                   {"no OpenCL device " + number + ": there " + there, devices.front().info().name});
    expect_refused([&] { Device::select(number + "/0"); }, {"no OpenCL device " + number + ": there " + there});
    set_wanted(number);
    expect_refused([] { Device::select(); }, {"no OpenCL device " + number + " (EGOSGM_DEVICE): there " + there});
  }
}

TEST_F(DeviceTest, APartOfANameHasThreeCharactersAndALetter) {
  for (const Device& device : Device::list()) {
    const std::string& name = device.info().name;
    for (std::size_t i = 0; i + 2 <= name.size(); ++i) {
      for (const std::string& part : {name.substr(i, 1), name.substr(i, 2)}) {
        if (part.find_first_not_of("0123456789") == std::string::npos) continue;
        expect_refused([&] { Device::select(part); }, {"no OpenCL device fits", "three letters or more"});
        expect_refused([&] { Device::select(":" + part); }, {"no OpenCL device fits", "three letters or more"});
      }
    }
  }
  for (const std::string wanted : {":", "/0", " 0", "0 ", "0.", "+0", "0,0", "..."}) {
    expect_refused([&] { Device::select(wanted); },
                   {"no OpenCL device fits \"" + wanted + "\"", "three letters or more"});
  }
}

TEST_F(DeviceTest, TellsWhetherTwoHaveComputeUnitsInCommon) {
  const std::vector<Device> devices = Device::list();
  for (std::size_t i = 0; i < devices.size(); ++i) {
    for (std::size_t k = 0; k < devices.size(); ++k) EXPECT_EQ(devices[i].shares_units(Device::list()[k]), i == k);
  }
}

TEST_F(DeviceTest, IsSelectedByPlatformAndName) {
  for (const Device& device : Device::list()) {
    const DeviceInfo& info = device.info();
    if (info.name.find(':') != std::string::npos || info.platform.find(':') != std::string::npos) continue;
    const Device selected = Device::select(info.platform + ":" + changed_case(info.name));
    EXPECT_EQ(selected.info().name, info.name);
    EXPECT_EQ(selected.info().platform, info.platform);
    EXPECT_TRUE(is_same(Device::select(":" + info.name), selected));
    expect_refused([&] { Device::select("no such platform:" + info.name); }, {"no OpenCL device fits", info.name});
    expect_refused([&] { Device::select(info.platform + ":no such device"); }, {"no OpenCL device fits", info.name});
  }
}

TEST_F(DeviceTest, IsSelectedByTheEnvironmentUnlessTheCallerNamesOne) {
  const std::vector<Device> devices = Device::list();
  set_wanted(devices.back().info().name);
  EXPECT_EQ(Device::select().info().name, devices.back().info().name);
  set_wanted("no such device");
  expect_refused([] { Device::select(); }, {"no OpenCL device fits \"no such device\"", "EGOSGM_DEVICE"});
  EXPECT_TRUE(is_same(Device::select("0"), devices.front()));
}

/// A device of at least two compute units that its driver divides.
std::optional<Device> divisible_device() {
  for (const Device& device : Device::list()) {
    if (device.info().compute_units < 2) continue;
    try {
      device.compute_units(0, 0);
      return device;
    } catch (const InvalidArgument&) {
    }
  }
  return std::nullopt;
}

TEST_F(DeviceTest, ComputeUnitsAreDevicesOfTheirOwn) {
  const auto whole = divisible_device();
  if (!whole) GTEST_SKIP() << "no device here can be divided";
  const DeviceInfo& info = whole->info();
  const std::string last = std::to_string(info.compute_units - 1);
  for (const auto& [ending, units] :
       {std::pair<std::string, int>{"/0", 1}, {"/" + last, 1}, {"/0-" + last, info.compute_units}}) {
    const Device part = Device::select(changed_case(info.name) + ending);
    EXPECT_EQ(part.info().name, ending == "/0-0" ? info.name + "/0" : info.name + ending);
    EXPECT_EQ(part.info().compute_units, units);
    EXPECT_EQ(part.info().driver, info.driver);
    EXPECT_EQ(Device::select(part.info().name).info().name, part.info().name);
    set_wanted(part.info().name);
    EXPECT_EQ(Device::select().info().name, part.info().name);
  }
  EXPECT_EQ(Device::select("0/0").info().name, Device::list().front().info().name + "/0");
  const std::string unit_of_part = whole->compute_units(0, info.compute_units - 1).compute_units(0, 0).info().name;
  EXPECT_EQ(Device::select(unit_of_part).info().name, unit_of_part);
}

TEST_F(DeviceTest, PartsShareUnitsWithTheWholeAndWhereTheyOverlap) {
  const auto whole = divisible_device();
  if (!whole) GTEST_SKIP() << "no device here can be divided";
  const int last = whole->info().compute_units - 1;
  const Device first_unit = whole->compute_units(0, 0), last_unit = whole->compute_units(last, last);
  for (const Device& part : {first_unit, last_unit, whole->compute_units(0, last)}) {
    EXPECT_TRUE(part.shares_units(*whole));
    EXPECT_TRUE(whole->shares_units(part));
    EXPECT_TRUE(part.shares_units(whole->compute_units(0, last)));
  }
  EXPECT_FALSE(first_unit.shares_units(last_unit));
  EXPECT_FALSE(last_unit.shares_units(first_unit));
  EXPECT_TRUE(last_unit.shares_units(whole->compute_units(last, last)));
}

TEST_F(DeviceTest, RefusesComputeUnitsThatAreNotThere) {
  const auto whole = divisible_device();
  if (!whole) GTEST_SKIP() << "no device here can be divided";
  const std::string units = std::to_string(whole->info().compute_units);
  for (const std::string& ending : {"/" + units, "/0-" + units, std::string("/1-0"), std::string("/99999")}) {
    expect_refused([&] { Device::select(whole->info().name + ending); },
                   {whole->info().name + ": compute units ", "it has " + units + ", numbered from 0"});
  }
  for (const std::string ending : {"/", "/-1", "/0-", "/a", "/0-1-2", "/99999999999"}) {
    expect_refused([&] { Device::select(whole->info().name + ending); }, {"no OpenCL device fits"});
  }
  expect_refused([&] { whole->compute_units(-1, 0); }, {"compute units -1 to 0"});
}

TEST_F(DeviceTest, RefusesUnknownNamesWithTheList) {
  for (const std::string wanted : {"No Such Device", "-1", "0x0", ":::"}) {
    for (const Device& device : Device::list()) {
      expect_refused([&] { Device::select(wanted); },
                     {"no OpenCL device fits \"" + wanted + "\"", "choose one of 0 = ", device.info().name,
                      device.info().platform, to_string(device.info().type)});
    }
  }
}

// The loader looks for drivers once in a process, so that takes one of its own.
TEST(DeviceDeathTest, TellsHowToInstallOneWhereThereIsNone) {
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_EXIT(
      {
        const std::filesystem::path folder =
            std::filesystem::path(::testing::TempDir()) / ("egosgm_no_drivers_" + std::to_string(getpid()));
        std::filesystem::create_directory(folder);
        setenv("OCL_ICD_VENDORS", folder.c_str(), 1);
        unsetenv("OCL_ICD_FILENAMES");
        const bool none = Device::list().empty();
        std::string line;
        try {
          Device::select("0");
        } catch (const InvalidArgument& error) {
          line = error.what();
        }
        std::filesystem::remove(folder);
        std::fprintf(stderr, "%s\n", line.c_str());
        std::exit(none && line.find('\n') == std::string::npos ? 0 : 1);
      },
      ::testing::ExitedWithCode(0), "no OpenCL device: install one, .*apt install pocl-opencl-icd");
}

}  // namespace
}  // namespace egosgm
