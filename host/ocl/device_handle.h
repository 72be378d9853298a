// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "egosgm/device.h"
#include "host/ocl/opencl.h"

namespace egosgm {

struct Device::Handle {
  cl::Device device;
  DeviceInfo info;
};

}  // namespace egosgm
