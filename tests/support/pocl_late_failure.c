// SPDX-License-Identifier: Apache-2.0
// Shows a fault of PoCL 3.1 that tests/support/fault_layer.cpp steers around; docs/understand/reliability.md tells of it. A
// command that fails while another one of its queue still runs is notified by that one when it ends, though it is gone
// by then. cc -o late tests/support/pocl_late_failure.c -lOpenCL && ./late: ends by a failed assertion of PoCL
// within seconds. ./late wait, which lets the earlier command end first, says how many rounds went well.
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <stdio.h>
#include <stdlib.h>

#define OK(call)                                 \
  do {                                           \
    const cl_int status_of_call = (call);        \
    if (status_of_call != CL_SUCCESS) {          \
      printf("%s: %d\n", #call, status_of_call); \
      exit(1);                                   \
    }                                            \
  } while (0)

enum { kBytes = 1 << 16, kRounds = 100000 };

int main(int argc, char** argv) {
  const int waits = argc > 1;
  (void)argv;
  cl_platform_id platform;
  cl_device_id device;
  OK(clGetPlatformIDs(1, &platform, NULL));
  OK(clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &device, NULL));
  cl_context context = clCreateContext(NULL, 1, &device, NULL, NULL, NULL);
  cl_command_queue queue = clCreateCommandQueue(context, device, 0, NULL);
  cl_mem buffer = clCreateBuffer(context, CL_MEM_READ_WRITE, kBytes, NULL, NULL);
  const unsigned char zero = 0;
  for (int round = 0; round < kRounds; ++round) {
    cl_event earlier, failing;
    OK(clEnqueueFillBuffer(queue, buffer, &zero, 1, 0, kBytes, 0, NULL, &earlier));
    if (waits) OK(clFinish(queue));
    cl_event fault = clCreateUserEvent(context, NULL);
    OK(clEnqueueFillBuffer(queue, buffer, &zero, 1, 0, kBytes, 1, &fault, &failing));
    OK(clSetUserEventStatus(fault, CL_OUT_OF_RESOURCES));
    OK(clReleaseEvent(fault));
    cl_int status;
    do {
      OK(clGetEventInfo(earlier, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof status, &status, NULL));
    } while (status > CL_COMPLETE);
    OK(clReleaseEvent(failing));
    OK(clReleaseEvent(earlier));
  }
  printf("%d rounds went well\n", kRounds);
  return 0;
}
