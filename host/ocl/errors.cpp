// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/errors.h"

#include "egosgm/error.h"

namespace egosgm::ocl {

std::string status_name(int status) {
  switch (status) {
    case CL_DEVICE_NOT_AVAILABLE:
      return "CL_DEVICE_NOT_AVAILABLE";
    case CL_COMPILER_NOT_AVAILABLE:
      return "CL_COMPILER_NOT_AVAILABLE";
    case CL_MEM_OBJECT_ALLOCATION_FAILURE:
      return "CL_MEM_OBJECT_ALLOCATION_FAILURE";
    case CL_OUT_OF_RESOURCES:
      return "CL_OUT_OF_RESOURCES";
    case CL_OUT_OF_HOST_MEMORY:
      return "CL_OUT_OF_HOST_MEMORY";
    case CL_PROFILING_INFO_NOT_AVAILABLE:
      return "CL_PROFILING_INFO_NOT_AVAILABLE";
    case CL_BUILD_PROGRAM_FAILURE:
      return "CL_BUILD_PROGRAM_FAILURE";
    case CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST:
      return "CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST";
    case CL_INVALID_WORK_GROUP_SIZE:
      return "CL_INVALID_WORK_GROUP_SIZE";
    case CL_INVALID_BUFFER_SIZE:
      return "CL_INVALID_BUFFER_SIZE";
    default:
      return std::to_string(status);
  }
}

std::string cache_remedy(const std::string& platform) {
  if (platform != "Portable Computing Language") return {};
  return "PoCL needs a cache that it can write: set POCL_CACHE_DIR to such a folder, with some megabytes of room "
         "(without it, PoCL takes one in XDG_CACHE_HOME or HOME)";
}

void raise(const std::string& stage, const cl::Error& error) {
  const bool memory = error.err() == CL_MEM_OBJECT_ALLOCATION_FAILURE || error.err() == CL_OUT_OF_RESOURCES ||
                      error.err() == CL_OUT_OF_HOST_MEMORY;
  throw DeviceError(error.err(), stage + ": " + error.what() + " failed with OpenCL status " +
                                     status_name(error.err()) + ": " +
                                     (memory ? "choose fewer disparities, a smaller image or another device"
                                             : "try again, or choose another device"));
}

}  // namespace egosgm::ocl
