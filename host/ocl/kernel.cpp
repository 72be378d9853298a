// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/kernel.h"

#include <functional>
#include <numeric>

#include "egosgm/error.h"

namespace egosgm::ocl {
namespace {

bool this_cpu_counts_bits() {
#if defined(__x86_64__) && defined(__GNUC__)
  return __builtin_cpu_supports("avx512vpopcntdq");
#else
  return false;
#endif
}

std::size_t work_items(const cl::NDRange& local) {
  return std::accumulate(local.get(), local.get() + local.dimensions(), std::size_t{1}, std::multiplies<>());
}

}  // namespace

bool is_this_cpu_by_pocl(const std::string& version) {
  return version.find(" PoCL HSTR: ") != std::string::npos && version.find("-x86_64-") != std::string::npos;
}

bool counts_bits(const Context& context) {
  const cl::Device& device = context.device();
  return this_cpu_counts_bits() && device.getInfo<CL_DEVICE_TYPE>() & CL_DEVICE_TYPE_CPU &&
         is_this_cpu_by_pocl(device.getInfo<CL_DEVICE_VERSION>());
}

MadeKernel::MadeKernel(const cl::Program& program, const char* name, const std::vector<std::string>& signature)
    : kernel(program, name) {
  expect_signature(kernel, signature);
  const cl::Device device = program.getInfo<CL_PROGRAM_DEVICES>().front();
  max_work_group_size = kernel.getWorkGroupInfo<CL_KERNEL_WORK_GROUP_SIZE>(device);
  has_fixed_group = kernel.getWorkGroupInfo<CL_KERNEL_COMPILE_WORK_GROUP_SIZE>(device)[0] > 0;
}

cl::NDRange halved_to(const cl::NDRange& local, std::size_t limit) {
  cl::NDRange fitting = local;
  while (work_items(fitting) > limit && fitting.get()[0] % 2 == 0) fitting.get()[0] /= 2;
  return fitting;
}

void expect_work_group(const Context& context, const char* kernel, const cl::NDRange& local, std::size_t limit) {
  if (work_items(local) <= limit) return;
  throw DeviceError(CL_INVALID_WORK_GROUP_SIZE,
                    std::string(context.stage()) + ": kernel " + kernel + " needs work-groups of " +
                        std::to_string(work_items(local)) + " work-items, the device allows " + std::to_string(limit) +
                        " for it: choose fewer disparities, other sizes (--tuning none) or another device");
}

}  // namespace egosgm::ocl
