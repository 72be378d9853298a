// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/ocl/buffer.h"
#include "host/ocl/signature.h"
#include "kernels/shared.h"

namespace egosgm::ocl {

/// The shape of a launch.
struct Range {
  cl::NDRange global;
  cl::NDRange local;
};

/// Whether work-items are lanes, of which many share what they wait for.
inline bool is_gpu(const Context& context) { return context.device().getInfo<CL_DEVICE_TYPE>() == CL_DEVICE_TYPE_GPU; }

/// A work-item a pixel and view: global ids are x, y, view. x is rounded up, so kernels guard their bounds. Groups are
/// of 128 on GPUs, some of which hold 16 groups at once and 48 warps of 32.
inline Range every_pixel(const Context& context, shared::ImageSize size, int views = 2) {
  std::size_t local = is_gpu(context) ? 128 : 64;
  while (local > context.max_work_group_size()) local /= 2;
  return {cl::NDRange((size.width + local - 1) / local * local, size.height, views), cl::NDRange(local, 1, 1)};
}

/// For kernels that go over a row by FOR_PIXELS (kernels/pixels.h): a work-item a pixel and view where `pixels` is 1,
/// else a work-item a row and view, whose compilers then know the loop. Global ids 1 and 2 are y and view.
inline Range every_pixels(const Context& context, shared::ImageSize size, int pixels, int views = 2) {
  if (pixels == 1) return every_pixel(context, size, views);
  return {cl::NDRange(1, size.height, views), cl::NDRange(1, 1, 1)};
}

/// A work-item a row and view: global ids are y, view. A CPU's work-groups hold one: it deals out groups, and rows are
/// long.
inline Range every_row(const Context& context, shared::ImageSize size, int views = 2) {
  return {cl::NDRange(size.height, views), is_gpu(context) ? cl::NullRange : cl::NDRange(1, 1)};
}

/// A work-group of `work_items` a row and view: local id 0 is the lane, global ids 1 and 2 are y and view.
inline Range group_a_row(shared::ImageSize size, int work_items, int views = 2) {
  return {cl::NDRange(work_items, size.height, views), cl::NDRange(work_items, 1, 1)};
}

/// The number of work-items that share a row whose values build on one another: many where a work-item is slow, else
/// one.
inline int row_group(const Context& context) {
  return is_gpu(context) ? static_cast<int>(std::min<std::size_t>(128, context.max_work_group_size())) : 1;
}

/// PIXELS of kernels/pixels.h: one where work-items are lanes, else a vector.
inline int pixels_a_work_item(const Context& context) { return is_gpu(context) ? 1 : 16; }

/// Whether a device of this version is the CPU that this program runs on, by PoCL. Its remote driver gives devices of
/// other machines with the same platform, type and name, but "pocl-remote" in place of what it compiles for.
bool is_this_cpu_by_pocl(const std::string& version);

/// Whether the device is this machine's CPU, which counts the bits of each lane of a vector in one instruction, and its
/// compiler is one that may be told so (kernels/sgm/banded_sgm.cl).
bool counts_bits(const Context& context);

/// Throws DeviceError, naming the stage, the kernel and the limit, where `local` has more work-items than `limit`.
void expect_work_group(const Context& context, const char* kernel, const cl::NDRange& local, std::size_t limit);

/// `local` with its first side halved until it has no more work-items than `limit`: what launches that only guard their
/// bounds can do with. The global size, a multiple of the former, is one of it too.
cl::NDRange halved_to(const cl::NDRange& local, std::size_t limit);

/// A kernel of a program, by its name.
struct MadeKernel {
  cl::Kernel kernel;
  std::size_t max_work_group_size = 0;
  bool has_fixed_group = false;  // by reqd_work_group_size

  MadeKernel() = default;
  MadeKernel(const cl::Program& program, const char* name, const std::vector<std::string>& signature);
};

/// A kernel with its C++ signature: `Buffer<T>` for `global T*`, `const Buffer<T>` for
/// `global const T*`, anything else by value.
template <typename... Params>
class Kernel {
 public:
  /// `name`: a string literal. Made when the program is built, which throws std::logic_error where the .cl does not fit
  /// the signature.
  Kernel(Program& program, const char* name) : name_(name) {
    program.when_built([made = made_, name](const cl::Program& built) {
      *made = MadeKernel(built, name, {KernelParameter<Params>::text()...});
    });
  }
  Kernel(const cl::Program& program, const char* name)
      : name_(name),
        made_(std::make_shared<MadeKernel>(program, name,
                                           std::vector<std::string>{KernelParameter<Params>::text()...})) {}

  /// Throws DeviceError where the device, for what this kernel takes of it, cannot hold the range's work-groups and the
  /// kernel needs them so large. Of a program that was not built, builds it.
  void operator()(Context& context, const Range& range, Params&... args) {
    if (!made_->kernel()) context.build();
    const std::size_t limit = made_->max_work_group_size;
    const cl::NDRange local = made_->has_fixed_group ? range.local : halved_to(range.local, limit);
    expect_work_group(context, name_, local, limit);
    cl_uint index = 0;
    (set(index++, args), ...);
    cl::Event done;
    context.queue().enqueueNDRangeKernel(made_->kernel, cl::NullRange, range.global, local, nullptr, &done);
    context.record(done, name_, Queue::kKernels, /*is_launch=*/true);
  }

 private:
  template <typename T>
  void set(cl_uint index, const Buffer<T>& buffer) {
    made_->kernel.setArg(index, buffer.get());
  }
  template <typename T>
  void set(cl_uint index, const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
    made_->kernel.setArg(index, sizeof(T), &value);
  }

  const char* name_;
  std::shared_ptr<MadeKernel> made_ = std::make_shared<MadeKernel>();
};

}  // namespace egosgm::ocl
