// SPDX-License-Identifier: Apache-2.0
#include "bench/device_copy.h"

#include <algorithm>
#include <chrono>

#include "host/ocl/buffer.h"

namespace egosgm::bench {
namespace {

constexpr const char* kCopy =
    "kernel void copy(global const uint4* from, global uint4* to) { to[get_global_id(0)] = from[get_global_id(0)]; }";
constexpr std::size_t kElements = std::size_t{16} << 20;  // of 16 bytes

}  // namespace

double copy_gb_s(ocl::Context& context) {
  context.enter("copy");
  const ocl::Buffer<cl_uint4> from(context, kElements), to(context, kElements);
  cl::Program program(context.get(), kCopy, /*build=*/true);
  cl::Kernel copy(program, "copy");
  copy.setArg(0, from.get());
  copy.setArg(1, to.get());
  double best_s = 1e9;
  for (int round = 0; round < 10; ++round) {
    const auto start = std::chrono::steady_clock::now();
    cl::Event done;
    context.queue().enqueueNDRangeKernel(copy, cl::NullRange, cl::NDRange(kElements), cl::NDRange(64), nullptr, &done);
    context.record(done, "copy");
    context.wait();
    const double s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (round > 0) best_s = std::min(best_s, s);  // the first one touches the pages
  }
  return 2.0 * sizeof(cl_uint4) * kElements / best_s * 1e-9;
}

}  // namespace egosgm::bench
