// SPDX-License-Identifier: Apache-2.0
#include "bench/roofs.h"

#include <algorithm>
#include <chrono>
#include <vector>

#include "host/ocl/buffer.h"
#include "host/ocl/kernel.h"

namespace egosgm::bench {
namespace {

// Eight vectors to a work-item, which do not wait for one another; each has a name, as some compilers keep arrays in
// memory.
constexpr const char* kKernels = R"(
#define EACH(DO) DO(0) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7)
#define ADD_TO_SUM(k) sum ^= v##k;
kernel void copy(global const uint4* from, global uint4* to) { to[get_global_id(0)] = from[get_global_id(0)]; }
kernel void min_add(const int turns, global ushort16* out) {
#define SHORTS(k) ushort16 v##k = (ushort16)((ushort)(get_global_id(0) + k));
#define MIN_ADD(k) v##k = min(v##k + step, most);
  EACH(SHORTS)
  const ushort16 step = out[get_global_id(0)], most = out[0];
  for (int i = 0; i < turns; ++i) { EACH(MIN_ADD) }
  ushort16 sum = 0;
  EACH(ADD_TO_SUM)
  out[get_global_id(0)] = sum;
}
kernel void count_bits(const int turns, global uint16* out) {
#define WORDS(k) uint16 v##k = (uint16)((uint)(get_global_id(0) + k));
#define COUNT_BITS(k) v##k = popcount(v##k);
  EACH(WORDS)
  for (int i = 0; i < turns; ++i) { EACH(COUNT_BITS) }
  uint16 sum = 0;
  EACH(ADD_TO_SUM)
  out[get_global_id(0)] = sum;
}
kernel void nothing(global uint* out) {}
kernel void rotate_local(const int turns, global uint* out, local uint* memory) {
  const int lane = get_local_id(0), lanes = get_local_size(0);
  memory[lane] = lane;
  for (int i = 0; i < turns; ++i) {
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint next = memory[(lane + 1) % lanes];
    barrier(CLK_LOCAL_MEM_FENCE);
    memory[lane] = next + i;
  }
  out[get_global_id(0)] = memory[lane];
}
kernel void wait_for_all(const int turns, global uint* out) {
  for (int i = 0; i < turns; ++i) barrier(CLK_LOCAL_MEM_FENCE);
  out[get_global_id(0)] = turns;
}
)";
constexpr std::size_t kElements = std::size_t{16} << 20;  // of 16 bytes
constexpr int kRounds = 10, kTurns = 500, kLaunches = 100;
constexpr std::size_t kGroup = 64;
constexpr double kValuesOfAnItem = 8 * 16.0 * kTurns;

/// The least of the seconds that `f` returns, but for the first call, which pays what only comes once.
template <typename F>
double least_s(F&& f) {
  double least = 1e9;
  for (int round = 0; round < kRounds; ++round) {
    const double s = f();
    if (round > 0) least = std::min(least, s);
  }
  return least;
}

std::size_t units_of(const ocl::Context& context) { return context.device().getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>(); }

/// Work-items that keep every unit busy: a GPU's hides what an item waits for behind the others of its unit.
std::size_t items_of(const ocl::Context& context) { return ocl::is_gpu(context) ? 2048 * units_of(context) : 4096; }

class Kernels {
 public:
  explicit Kernels(ocl::Context& context)
      : context_(context), items_(items_of(context)), program_(context.get(), kKernels), values_(context, 16 * items_) {
    // CLHPP builds by itself for OpenCL C 2.0, which not every driver has.
    program_.build("-cl-std=CL1.2");
    context.enter("roofs");
    values_.fill(context, 3);
    context.wait();
  }

  double copy_gb_s() {
    const ocl::Buffer<cl_uint4> from(context_, kElements), to(context_, kElements);
    cl::Kernel copy(program_, "copy");
    copy.setArg(0, from.get());
    copy.setArg(1, to.get());
    return 2.0 * sizeof(cl_uint4) * kElements * 1e-9 / least_s([&] { return run(copy, kElements, kGroup); });
  }
  /// 10^9 values a second, `each` of them a turn.
  double values_g_s(const char* name, double each) {
    return each * kValuesOfAnItem * static_cast<double>(items_) * 1e-9 / turns_s(name, 1, items_);
  }
  double turns_s(const char* name, std::size_t group, std::size_t items, std::size_t local_bytes = 0) {
    cl::Kernel kernel(program_, name);
    kernel.setArg(0, cl_int{kTurns});
    kernel.setArg(1, values_.get());
    if (local_bytes > 0) kernel.setArg(2, local_bytes, nullptr);
    return least_s([&] { return run(kernel, items, ocl::is_gpu(context_) ? kGroup : group); });
  }
  double launch_us() {
    cl::Kernel nothing(program_, "nothing");
    nothing.setArg(0, values_.get());
    return 1e6 / kLaunches * least_s([&] { return run(nothing, kGroup, kGroup, kLaunches); });
  }
  double enqueue_us() {
    cl::Kernel nothing(program_, "nothing");
    nothing.setArg(0, values_.get());
    return 1e6 / kLaunches * least_s([&] {
             const auto start = std::chrono::steady_clock::now();
             run(nothing, kGroup, kGroup, kLaunches);
             return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
           });
  }
  std::size_t items() const { return items_; }

 private:
  /// Seconds on the device.
  double run(const cl::Kernel& kernel, std::size_t items, std::size_t group, int launches = 1) {
    std::vector<cl::Event> done(launches);
    for (cl::Event& each : done) {
      context_.queue().enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(items), cl::NDRange(group), nullptr,
                                            &each);
      context_.record(each, "roof");
    }
    context_.wait();
    double ns = 0;
    for (const cl::Event& each : done) {
      ns += static_cast<double>(each.getProfilingInfo<CL_PROFILING_COMMAND_END>() -
                                each.getProfilingInfo<CL_PROFILING_COMMAND_START>());
    }
    return 1e-9 * ns;
  }

  ocl::Context& context_;
  const std::size_t items_;
  cl::Program program_;
  ocl::Buffer<cl_uint> values_;
};

}  // namespace

double copy_gb_s(ocl::Context& context) { return Kernels(context).copy_gb_s(); }

Roofs roofs_of(ocl::Context& context) {
  Kernels kernels(context);
  Roofs roofs{.copy_gb_s = kernels.copy_gb_s(),
              .min_add_g_s = kernels.values_g_s("min_add", 2),
              .popcount_g_s = kernels.values_g_s("count_bits", 1),
              .launch_us = kernels.launch_us(),
              .enqueue_us = kernels.enqueue_us()};
  if (!ocl::is_gpu(context)) return roofs;
  const double turns = kTurns * static_cast<double>(kernels.items());
  roofs.local_gb_s = 2 * sizeof(cl_uint) * turns * 1e-9 /
                     kernels.turns_s("rotate_local", kGroup, kernels.items(), kGroup * sizeof(cl_uint));
  roofs.barrier_ns = 1e9 * kernels.turns_s("wait_for_all", kGroup, kGroup * units_of(context)) / kTurns;
  return roofs;
}

}  // namespace egosgm::bench
