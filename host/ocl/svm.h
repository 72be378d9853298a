// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "host/ocl/opencl.h"

namespace egosgm::ocl {

/// A buffer that is the first `bytes` bytes of an allocation by clSVMAlloc in `context`: no copy. Throws
/// InvalidArgument where the device has no shared virtual memory, or the pointer is none, or the allocation is smaller.
cl::Buffer buffer_in_svm(const cl::Context& context, const cl::Device& device, const void* allocation,
                         std::size_t bytes);

}  // namespace egosgm::ocl
