// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/context.h"
#include "host/ocl/device_handle.h"

namespace egosgm::testing {

/// The device that the tests run on: EGOSGM_DEVICE, else the preferred one.
inline cl::Device any_device() { return Device::select().handle().device; }

/// On it, one for all tests of the process: what one of them builds, the others have.
inline ocl::Context& shared_context() {
  static ocl::Context& context = *new ocl::Context(any_device());  // lives longer than the driver
  return context;
}

}  // namespace egosgm::testing
