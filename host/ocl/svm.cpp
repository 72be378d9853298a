// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/svm.h"

#include <string>

#include "egosgm/error.h"

namespace egosgm::ocl {
namespace {

// CL_DEVICE_SVM_CAPABILITIES and CL_MEM_USES_SVM_POINTER, which the headers have from OpenCL 2.0 on only.
constexpr cl_device_info kSvmCapabilities = 0x1053;
constexpr cl_mem_info kUsesSvmPointer = 0x1109;

/// Devices before OpenCL 2.0 do not know the question; from 3.0 on the answer may be 0.
bool has_svm(const cl::Device& device) {
  cl_bitfield capabilities = 0;
  return ::clGetDeviceInfo(device(), kSvmCapabilities, sizeof capabilities, &capabilities, nullptr) == CL_SUCCESS &&
         capabilities != 0;
}

bool uses_svm(const cl::Buffer& buffer) {
  cl_bool uses = CL_FALSE;
  return ::clGetMemObjectInfo(buffer(), kUsesSvmPointer, sizeof uses, &uses, nullptr) == CL_SUCCESS && uses;
}

}  // namespace

cl::Buffer buffer_in_svm(const cl::Context& context, const cl::Device& device, const void* allocation,
                         std::size_t bytes) {
  if (!has_svm(device)) {
    throw InvalidArgument("enqueue: the device " + device.getInfo<CL_DEVICE_NAME>() +
                          " has no shared virtual memory: give the images as a cl_mem");
  }
  cl_int status = CL_SUCCESS;
  cl_mem memory = ::clCreateBuffer(context(), CL_MEM_READ_ONLY | CL_MEM_USE_HOST_PTR, bytes,
                                   const_cast<void*>(allocation), &status);
  if (status == CL_INVALID_BUFFER_SIZE) {
    throw InvalidArgument("enqueue: the images' allocation has fewer bytes than the " + std::to_string(bytes) +
                          " of a pair: left image, then right image, without gaps");
  }
  if (status != CL_SUCCESS) throw cl::Error(status, "clCreateBuffer");
  cl::Buffer buffer(memory);
  if (!uses_svm(buffer)) {
    throw InvalidArgument(
        "enqueue: the images' pointer is not what clSVMAlloc returned in the queue's context: give that, or a cl_mem");
  }
  return buffer;
}

}  // namespace egosgm::ocl
