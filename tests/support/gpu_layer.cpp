// SPDX-License-Identifier: Apache-2.0
// An OpenCL layer by which every device is a GPU, so that a CPU's driver runs what stages choose for GPUs: work-items
// for pixels, work-groups for rows and paths. OPENCL_LAYERS loads it.
#define CL_TARGET_OPENCL_VERSION 300
#include <CL/cl.h>
#include <CL/cl_icd.h>
#include <CL/cl_layer.h>

namespace {

cl_icd_dispatch layer{};
const cl_icd_dispatch* next = nullptr;

cl_int CL_API_CALL device_info(cl_device_id device, cl_device_info what, size_t size, void* value, size_t* needed) {
  const cl_int status = next->clGetDeviceInfo(device, what, size, value, needed);
  if (status == CL_SUCCESS && what == CL_DEVICE_TYPE && value)
    *static_cast<cl_device_type*>(value) = CL_DEVICE_TYPE_GPU;
  return status;
}

}  // namespace

extern "C" cl_int CL_API_CALL clInitLayer(cl_uint, const cl_icd_dispatch* target, cl_uint* count,
                                          const cl_icd_dispatch** out) {
  next = target;
  layer = *target;
  layer.clGetDeviceInfo = device_info;
  *count = sizeof(layer) / sizeof(layer.clGetPlatformIDs);
  *out = &layer;
  return CL_SUCCESS;
}
