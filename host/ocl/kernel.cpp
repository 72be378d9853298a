// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/kernel.h"

#include <functional>
#include <numeric>

#include "egosgm/error.h"
#include "host/ocl/strings.h"

namespace egosgm::ocl {
namespace {

bool this_cpu_counts_bits() {
#if defined(__x86_64__) && defined(__GNUC__)
  return __builtin_cpu_supports("avx512vpopcntdq");
#else
  return false;
#endif
}

}  // namespace

bool counts_bits(const Context& context) {
  const cl::Device& device = context.device();
  const cl::Platform platform(device.getInfo<CL_DEVICE_PLATFORM>());
  return this_cpu_counts_bits() && device.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU &&
         trimmed(platform.getInfo<CL_PLATFORM_NAME>()) == "Portable Computing Language";
}

void expect_work_group(const Context& context, const char* kernel, const cl::NDRange& local, std::size_t limit) {
  const std::size_t work_items =
      std::accumulate(local.get(), local.get() + local.dimensions(), std::size_t{1}, std::multiplies<>());
  if (work_items <= limit) return;
  throw DeviceError(CL_INVALID_WORK_GROUP_SIZE, std::string(context.stage()) + ": kernel " + kernel +
                                                    " needs work-groups of " + std::to_string(work_items) +
                                                    " work-items, the device allows " + std::to_string(limit) +
                                                    " for it: choose fewer disparities or another device");
}

}  // namespace egosgm::ocl
