// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/tuning.h"

namespace egosgm {

/// The queues that a pipeline has of its device.
enum class DeviceQueue { kUpload, kKernels, kDownload };

/// In the order in which devices are preferred. By name: "GPU", "accelerator", "CPU".
enum class DeviceType { kGpu, kAccelerator, kCpu };
EGOSGM_EXPORT const char* to_string(DeviceType type);

/// Properties of an OpenCL device, as its driver tells them.
struct DeviceInfo {
  std::string name;  // "pthread-skylake-avx512-AMD EPYC"
  DeviceType type = DeviceType::kCpu;
  std::string vendor;
  std::string platform;  // "Portable Computing Language"
  std::string version;   // "OpenCL 3.0 PoCL ..."
  std::string driver;
  int compute_units = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t max_allocation_bytes = 0;
  /// Properties that equal bits need and the device does not promise: "denormals". Empty: it has all.
  std::vector<std::string> lacks;
};

/// An OpenCL device. Copies refer to the same one, and so does what was moved from. Thread-safe. In a process that was
/// forked from one that used a device, all that needs one throws DeviceError: drivers do not survive a fork.
class EGOSGM_EXPORT Device {
 public:
  Device(const Device&) = default;
  Device& operator=(const Device&) = default;

  /// All devices, in the order of their types; then as the platforms list them.
  static std::vector<Device> list();

  /// The device that `wanted` names: an index into `list()`, a type ("gpu", "cpu", "accelerator": the first of it), or
  /// a part of its name, vendor or platform (upper and lower case alike; "PLATFORM:NAME" for both) of at least three
  /// characters, with a letter among them. Empty: the environment variable EGOSGM_DEVICE, else the first of `list()`.
  /// A name that nothing fits as a whole may end in compute units: "cpu/0" is the first one of "cpu", "cpu/0-3" the
  /// first four, as a device of their own (see `compute_units`). Throws InvalidArgument with the list where nothing
  /// fits, where devices of different names do, and how to install one where there is none.
  static Device select(const std::string& wanted = {});

  /// The compute units `first` to `last` (from 0, both included) as a device of their own: one core, some cores. Its
  /// name is this one's with "/FIRST-LAST" after it, so `select` finds it by its name. Same bits as the whole device.
  /// Throws InvalidArgument where there are no such units, or where the driver does not divide the device.
  Device compute_units(int first, int last) const;

  /// Whether the two have a compute unit in common.
  bool shares_units(const Device& other) const;

  /// This device, on which pipelines take their programs from `folder`, as `compile_programs` made them
  /// (egosgm/programs.h), and compile nothing. Throws InvalidArgument where they were made for another device, platform
  /// or driver version; a Pipeline's constructor does where the folder lacks one of its programs, or has it from
  /// another version of the source.
  Device with_programs(const std::string& folder) const;

  /// This device, on which pipelines use these sizes. Throws InvalidArgument as Tuning::validate.
  Device with_tuning(const Tuning& tuning) const;

  /// This device, on which pipelines keep what the compiler makes in `folder`, and take it from there; "off":
  /// nowhere. It goes before the environment variable EGOSGM_CACHE; without both, drivers that keep no programs
  /// themselves get $XDG_CACHE_HOME/egosgm or ~/.cache/egosgm. A folder that cannot be used is no error.
  Device with_cache(const std::string& folder) const;

  const DeviceInfo& info() const;

  struct Handle;  // the OpenCL side, host/ocl/device_handle.h
  const Handle& handle() const { return *handle_; }
  explicit Device(std::shared_ptr<const Handle> handle) : handle_(std::move(handle)) {}

 private:
  std::shared_ptr<const Handle> handle_;
};

}  // namespace egosgm
