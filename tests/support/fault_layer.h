// SPDX-License-Identifier: Apache-2.0
#pragma once

#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 120
#endif
#include <CL/cl.h>
#include <dlfcn.h>

#include <stdexcept>
#include <string>

namespace egosgm::testing {

/// What the layer can be told and asked. Counts are from zero.
struct FaultControls {
  enum How { kAtOnce, kLate, kRelease, kHeld };

  /// Lets call `at` return `code`, or command `at` fail after it was enqueued, or release `at` return `code` after it
  /// was done. -1: none. Held: the command says from the next `arm` to the one behind that it failed.
  void (*arm)(int at, int code, int how);
  void (*forbid_sources)(int forbidden);  // 1: no program can be made of its source from now on
  void (*reuse_builds)(int reused);       // 1: a program built before is taken from its binary from now on, at once
  void (*separate_memory)(int separate);  // 1: devices say from now on that they have memory of their own
  void (*hide_svm)(int hidden);           // 1: devices do not know shared virtual memory from now on
  void (*batch)(int batches);  // 1: a queue's commands begin from now on when it is flushed, or somebody waits
  int (*begun_by_wait)();      // since `batch`: commands that began as somebody waited for events
  int (*calls)();              // since `arm`: calls that can fail,
  int (*enqueues)();           // and commands among them
  int (*releases)();           // and releases beside them
  long (*references)();  // to contexts, queues, buffers, programs, kernels and events: created + retained - released
  long (*buffers_created)();  // ever
  int (*transfers)();         // ever: copies, reads, writes, maps and unmaps of buffers
};

/// The layer between this program and its OpenCL driver. Exists only where OPENCL_LAYERS named it before the first
/// OpenCL call.
struct FaultLayer : FaultControls {
  explicit FaultLayer(const char* file) {
    cl_uint platforms = 0;
    clGetPlatformIDs(0, nullptr, &platforms);  // the loader loads layers with the first call
    void* layer = dlopen(file, RTLD_NOW | RTLD_NOLOAD);
    if (!layer) throw std::runtime_error(std::string("run this test with OPENCL_LAYERS=") + file);
    static_cast<FaultControls&>(*this) = *static_cast<const FaultControls*>(dlsym(layer, "fault_controls"));
    disarm();
  }

  void disarm() const { arm(-1, 0, kAtOnce); }
};

}  // namespace egosgm::testing
