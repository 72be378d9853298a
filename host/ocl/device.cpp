// SPDX-License-Identifier: Apache-2.0
#include "egosgm/device.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdlib>
#include <initializer_list>
#include <mutex>
#include <optional>
#include <string_view>

#include "egosgm/error.h"
#include "host/ocl/device_handle.h"
#include "host/ocl/errors.h"
#include "host/ocl/own_process.h"
#include "host/ocl/strings.h"

namespace egosgm {
namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

DeviceType type_of(cl_device_type type) {
  if (type & CL_DEVICE_TYPE_GPU) return DeviceType::kGpu;
  if (type & CL_DEVICE_TYPE_ACCELERATOR) return DeviceType::kAccelerator;
  return DeviceType::kCpu;
}

/// Whether the driver says so; one that does not may have no such call at all (rusticl of Mesa 22.3).
bool divides_by_counts(const cl::Device& device) {
  const auto kinds = device.getInfo<CL_DEVICE_PARTITION_PROPERTIES>();
  return device.getInfo<CL_DEVICE_PARTITION_MAX_SUB_DEVICES>() > 0 &&
         std::find(kinds.begin(), kinds.end(), CL_DEVICE_PARTITION_BY_COUNTS) != kinds.end();
}

std::vector<std::string> lacks_of(const cl::Device& device) {
  const auto floats = device.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>();
  const std::pair<bool, const char*> wanted[] = {
      {floats & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT, "correctly rounded division"},
      {floats & CL_FP_DENORM, "denormals"},
      {floats & CL_FP_ROUND_TO_NEAREST, "rounding to nearest"},
      {floats & CL_FP_INF_NAN, "infinity and NaN"},
      {device.getInfo<CL_DEVICE_ENDIAN_LITTLE>(), "little-endian memory"},
      {device.getInfo<CL_DEVICE_COMPILER_AVAILABLE>(), "a compiler (take --programs)"},
      {divides_by_counts(device), "division into compute units"}};
  std::vector<std::string> lacks;
  for (const auto& [has, what] : wanted) {
    if (!has) lacks.push_back(what);
  }
  return lacks;
}

DeviceInfo describe(const cl::Device& device) {
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  return {.name = ocl::trimmed(device.getInfo<CL_DEVICE_NAME>()),
          .type = type_of(device.getInfo<CL_DEVICE_TYPE>()),
          .vendor = ocl::trimmed(device.getInfo<CL_DEVICE_VENDOR>()),
          .platform = ocl::trimmed(platform.getInfo<CL_PLATFORM_NAME>()),
          .version = ocl::trimmed(device.getInfo<CL_DEVICE_VERSION>()),
          .driver = ocl::trimmed(device.getInfo<CL_DRIVER_VERSION>()),
          .compute_units = static_cast<int>(device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>()),
          .memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>(),
          .max_allocation_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>(),
          .lacks = lacks_of(device)};
}

bool contains(const std::string& text, const std::string& part) { return lower(text).find(part) != std::string::npos; }

/// Whether the name, vendor or platform holds `wanted`; "PLATFORM:NAME": whether both do.
bool fits(const DeviceInfo& info, const std::string& wanted) {
  if (const auto colon = wanted.find(':'); colon != std::string::npos) {
    return contains(info.platform, wanted.substr(0, colon)) && contains(info.name, wanted.substr(colon + 1));
  }
  return contains(info.name, wanted) || contains(info.vendor, wanted) || contains(info.platform, wanted);
}

/// A part of a name: three characters with a letter among them. Less is found in names by chance, and a number is an
/// index.
bool is_name(std::string_view text) {
  return text.size() >= 3 && std::any_of(text.begin(), text.end(), [](unsigned char c) { return std::isalpha(c); });
}

/// "PLATFORM:NAME" may leave one of the two out.
bool is_name_of_device(std::string_view text) {
  const auto colon = text.find(':');
  if (colon == std::string_view::npos) return is_name(text);
  const std::string_view platform = text.substr(0, colon), name = text.substr(colon + 1);
  return (platform.empty() || is_name(platform)) && (name.empty() || is_name(name)) && text.size() > 1;
}

/// "NAME/FIRST-LAST" or "NAME/FIRST", numbers of compute units. None where `wanted` does not end so.
struct UnitRange {
  std::string device;
  int first = 0, last = 0;
};

std::optional<int> number_of(std::string_view text) {
  int number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number >= 0 ? std::optional(number) : std::nullopt;
}

std::optional<UnitRange> unit_range(const std::string& wanted) {
  const auto slash = wanted.rfind('/');
  if (slash == std::string::npos) return std::nullopt;
  const std::string_view units = std::string_view(wanted).substr(slash + 1);
  const auto dash = units.find('-');
  const auto first = number_of(units.substr(0, dash));
  const auto last = dash == std::string_view::npos ? first : number_of(units.substr(dash + 1));
  if (!first || !last) return std::nullopt;
  return UnitRange{wanted.substr(0, slash), *first, *last};
}

/// The compute units `first` to `last` of `device` as a device of their own.
cl::Device sub_device(const cl::Device& device, const DeviceInfo& info, int first, int last) {
  const std::string asked = info.name + ": compute units " + std::to_string(first) + " to " + std::to_string(last);
  if (first < 0 || first > last || last >= info.compute_units) {
    throw InvalidArgument(asked + ": it has " + std::to_string(info.compute_units) + ", numbered from 0");
  }
  if (!divides_by_counts(device)) {
    throw InvalidArgument(asked + ": its driver does not divide it: choose the whole device");
  }
  std::vector<cl_device_partition_property> counts{CL_DEVICE_PARTITION_BY_COUNTS};
  if (first > 0) counts.push_back(first);
  counts.push_back(last - first + 1);
  counts.insert(counts.end(), {CL_DEVICE_PARTITION_BY_COUNTS_LIST_END, 0});
  std::vector<cl::Device> parts;
  try {
    cl::Device(device).createSubDevices(counts.data(), &parts);
  } catch (const cl::Error& error) {
    throw InvalidArgument(asked + ": its driver does not divide it (OpenCL status " + ocl::status_name(error.err()) +
                          "): choose the whole device");
  }
  return parts.back();
}

std::string numbered(const std::vector<Device>& devices) {
  std::string text;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const DeviceInfo& info = devices[i].info();
    text += (i ? ", " : "") + std::to_string(i) + " = " + info.name + " (" + to_string(info.type) + ", " +
            info.platform + ")";
  }
  return text;
}

/// All devices, those of the kinds that are preferred first, and the names of the platforms that have none.
struct Found {
  std::vector<Device> devices;
  std::vector<std::string> platforms_without;
};

Found find_devices() {
  ocl::expect_own_process("devices");
  // Threads that are the first to ask a driver must not ask at once: PoCL 3.1 crashes.
  static std::mutex one_at_a_time;
  const std::lock_guard lock(one_at_a_time);
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    return {};  // the loader reports "no platform" as an error
  }
  Found found;
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {  // none is reported as an error
    }
    if (devices.empty()) found.platforms_without.push_back(ocl::trimmed(platform.getInfo<CL_PLATFORM_NAME>()));
    for (const cl::Device& device : devices) {
      found.devices.emplace_back(std::make_shared<const Device::Handle>(Device::Handle::of(device)));
    }
  }
  std::stable_sort(found.devices.begin(), found.devices.end(),
                   [](const Device& a, const Device& b) { return a.info().type < b.info().type; });
  return found;
}

/// What may keep devices from programs: those of the environment's variables that are set, each with its value.
std::string of_variables(std::initializer_list<const char*> names) {
  std::string text;
  for (const char* name : names) {
    const char* value = std::getenv(name);
    if (value) text += std::string("; ") + name + " is set to \"" + value + "\", which may hide one: unset it";
  }
  return text;
}

/// Describes platforms that have no device; empty without such.
std::string of_platforms_without(const std::vector<std::string>& platforms) {
  std::string text;
  for (const std::string& platform : platforms) {
    const std::string remedy = ocl::cache_remedy(platform);
    text += (text.empty() ? "the platform \"" : "; the platform \"") + platform +
            "\" is there, but has no device: " + (remedy.empty() ? "may this user open its device files?" : remedy);
  }
  return text.empty() ? text : text + of_variables({"POCL_DEVICES", "CUDA_VISIBLE_DEVICES"});
}

/// The device that `name` (lower case) means as a whole: an index, a type, a part of a name. Null: none. `origin` is
/// for messages.
const Device* find(const std::vector<Device>& devices, const std::string& name, const std::string& origin) {
  if (name.find_first_not_of("0123456789") == std::string::npos) {
    const auto index = number_of(name);
    if (index && *index < static_cast<int>(devices.size())) return &devices[*index];
    throw InvalidArgument("no OpenCL device " + name + origin + ": there " +
                          (devices.size() == 1 ? "is 1" : "are " + std::to_string(devices.size())) +
                          ", numbered from 0: " + numbered(devices));
  }
  const auto first_that = [&](const auto& is_meant) {
    const auto found = std::find_if(devices.begin(), devices.end(), is_meant);
    return found == devices.end() ? nullptr : &*found;
  };
  if (name == "gpu" || name == "cpu" || name == "accelerator") {
    return first_that([&](const Device& device) { return lower(to_string(device.info().type)) == name; });
  }
  if (const Device* whole = first_that([&](const Device& device) { return lower(device.info().name) == name; })) {
    return whole;
  }
  if (!is_name_of_device(name)) return nullptr;
  const Device* first = first_that([&](const Device& device) { return fits(device.info(), name); });
  const Device* another = first_that([&](const Device& device) {
    return fits(device.info(), name) &&
           (device.info().name != first->info().name || device.info().platform != first->info().platform);
  });
  if (!another) return first;
  throw InvalidArgument("the OpenCL device \"" + name + "\"" + origin + " may be " + first->info().name + " or " +
                        another->info().name + ": give its number or more of its name: " + numbered(devices));
}

/// Finds a whole device, or compute units of one.
std::optional<Device> find_whole_or_units(const std::vector<Device>& devices, const std::string& name,
                                          const std::string& origin) {
  if (name.empty()) return std::nullopt;
  if (const Device* device = find(devices, name, origin)) return *device;
  const std::optional<UnitRange> units = unit_range(name);
  const auto device = units ? find_whole_or_units(devices, units->device, origin) : std::nullopt;
  return device ? std::optional(device->compute_units(units->first, units->last)) : std::nullopt;
}

}  // namespace

const char* to_string(DeviceType type) {
  return type == DeviceType::kGpu ? "GPU" : type == DeviceType::kAccelerator ? "accelerator" : "CPU";
}

Device::Handle Device::Handle::of(const cl::Device& device) { return {device, describe(device)}; }

std::vector<Device> Device::list() { return find_devices().devices; }

Device Device::select(const std::string& wanted) {
  const Found found = find_devices();
  const std::string without = of_platforms_without(found.platforms_without);
  if (found.devices.empty()) {
    throw InvalidArgument("no OpenCL device: " +
                          (without.empty()
                               ? "install one, for the CPU `apt install pocl-opencl-icd` (Debian, Ubuntu) or, for "
                                 "Python alone, `pip install intel-opencl-rt`" +
                                     of_variables({"OCL_ICD_VENDORS", "OCL_ICD_FILENAMES"})
                               : without));
  }
  const char* from_environment = std::getenv("EGOSGM_DEVICE");
  const std::string given = !wanted.empty() ? wanted : from_environment ? from_environment : "";
  if (given.empty()) return found.devices.front();
  const std::string origin = wanted.empty() ? " (EGOSGM_DEVICE)" : "";
  if (const auto device = find_whole_or_units(found.devices, lower(given), origin)) return *device;
  throw InvalidArgument("no OpenCL device fits \"" + given + "\"" + origin + ": choose one of " +
                        numbered(found.devices) +
                        (is_name_of_device(given) ? "" : ": by its number, or three letters or more of its name") +
                        (without.empty() ? "" : "; " + without));
}

Device Device::compute_units(int first, int last) const {
  ocl::expect_own_process("compute_units");
  Handle part = *handle_;
  part.device = sub_device(handle_->device, handle_->info, first, last);
  part.info.name += "/" + std::to_string(first) + (last > first ? "-" + std::to_string(last) : "");
  part.info.compute_units = last - first + 1;
  part.first_unit += first;
  return Device(std::make_shared<const Handle>(std::move(part)));
}

bool Device::shares_units(const Device& other) const {
  const Handle &a = *handle_, &b = *other.handle_;
  return a.whole() == b.whole() && a.first_unit < b.first_unit + b.info.compute_units &&
         b.first_unit < a.first_unit + a.info.compute_units;
}

Device Device::with_programs(const std::string& folder) const {
  return ocl::translated("with_programs", [&] {
    Handle with = *handle_;
    with.programs = std::make_shared<const ocl::ProgramFolder>(folder, handle_->device);
    return Device(std::make_shared<const Handle>(std::move(with)));
  });
}

Device Device::with_tuning(const Tuning& tuning) const {
  tuning.validate();
  Handle with = *handle_;
  with.tuning = tuning;
  return Device(std::make_shared<const Handle>(std::move(with)));
}

Device Device::with_cache(const std::string& folder) const {
  Handle with = *handle_;
  with.cache = folder;
  return Device(std::make_shared<const Handle>(std::move(with)));
}

const DeviceInfo& Device::info() const { return handle_->info; }

}  // namespace egosgm
