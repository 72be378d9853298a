// SPDX-License-Identifier: Apache-2.0
#include "egosgm/device.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>

#include "egosgm/error.h"
#include "host/ocl/device_handle.h"

namespace egosgm {
namespace {

// CLHPP leaves the terminating zero of some drivers in its strings.
std::string trimmed(std::string text) {
  text = text.substr(0, text.find('\0'));
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  return text;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string type_name(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_GPU) return "GPU";
  if (type & CL_DEVICE_TYPE_ACCELERATOR) return "accelerator";
  return "CPU";
}

int preference(const std::string& type) { return type == "GPU" ? 0 : type == "accelerator" ? 1 : 2; }

DeviceInfo describe(const cl::Platform& platform, const cl::Device& device) {
  return {.name = trimmed(device.getInfo<CL_DEVICE_NAME>()),
          .type = type_name(device.getInfo<CL_DEVICE_TYPE>()),
          .vendor = trimmed(device.getInfo<CL_DEVICE_VENDOR>()),
          .platform = trimmed(platform.getInfo<CL_PLATFORM_NAME>()),
          .version = trimmed(device.getInfo<CL_DEVICE_VERSION>()),
          .driver = trimmed(device.getInfo<CL_DRIVER_VERSION>()),
          .compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>()),
          .memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>(),
          .max_allocation_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>()};
}

bool contains(const std::string& text, const std::string& part) { return lower(text).find(part) != std::string::npos; }

bool fits(const DeviceInfo& info, const std::string& wanted) {
  if (lower(info.type) == wanted) return true;
  if (const auto colon = wanted.find(':'); colon != std::string::npos) {
    return contains(info.platform, wanted.substr(0, colon)) && contains(info.name, wanted.substr(colon + 1));
  }
  return contains(info.name, wanted) || contains(info.vendor, wanted) || contains(info.platform, wanted);
}

std::string numbered(const std::vector<Device>& devices) {
  std::string text;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const DeviceInfo& info = devices[i].info();
    text += (i ? ", " : "") + std::to_string(i) + " = " + info.name + " (" + info.type + ", " + info.platform + ")";
  }
  return text;
}

}  // namespace

std::vector<Device> Device::list() {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    return {};  // the loader reports "no platform" as an error
  }
  std::vector<Device> devices;
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> found;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &found);
    } catch (const cl::Error&) {
      continue;  // a platform without a device
    }
    for (const cl::Device& device : found) {
      devices.push_back(Device(std::make_shared<const Handle>(Handle{device, describe(platform, device)})));
    }
  }
  std::stable_sort(devices.begin(), devices.end(), [](const Device& a, const Device& b) {
    return preference(a.info().type) < preference(b.info().type);
  });
  return devices;
}

Device Device::select(const std::string& wanted) {
  const std::vector<Device> devices = list();
  if (devices.empty()) {
    throw InvalidArgument(
        "no OpenCL device: install one, on Debian and Ubuntu `apt install pocl-opencl-icd` for the CPU");
  }
  const char* from_environment = std::getenv("EGOSGM_DEVICE");
  const std::string given = !wanted.empty() ? wanted : from_environment ? from_environment : "";
  const std::string name = lower(given);
  if (name.empty()) return devices.front();

  std::size_t index = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), index);
  if (error == std::errc() && end == name.data() + name.size() && index < devices.size()) return devices[index];
  for (const Device& device : devices) {
    if (fits(device.info(), name)) return device;
  }
  throw InvalidArgument("no OpenCL device fits \"" + given + "\"" + (wanted.empty() ? " (EGOSGM_DEVICE)" : "") +
                        ": choose one of " + numbered(devices));
}

const DeviceInfo& Device::info() const { return handle_->info; }

}  // namespace egosgm
