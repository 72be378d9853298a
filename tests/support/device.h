// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "host/ocl/context.h"
#include "host/ocl/device_handle.h"

namespace egosgm::testing {

/// The device that the tests run on: EGOSGM_DEVICE, else the preferred one.
inline cl::Device any_device() { return Device::select().handle().device; }

}  // namespace egosgm::testing
