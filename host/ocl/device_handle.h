// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/device.h"
#include "host/ocl/program_folder.h"

namespace egosgm {

struct Device::Handle {
  cl::Device device;
  DeviceInfo info;
  cl::Device whole = device;                                     // the device that `device` is a part of, or itself
  int first_unit = 0;                                            // of `whole`; there are info.compute_units
  std::shared_ptr<const ocl::ProgramFolder> programs = nullptr;  // null: compiles
  cl::CommandQueue queue = {};                                   // for kernels; empty: of the pipeline's own
  Tuning tuning = {};
  std::string cache = {};  // of programs, as ProgramCache::of takes it

  static Handle of(const cl::Device& device);
};

}  // namespace egosgm
