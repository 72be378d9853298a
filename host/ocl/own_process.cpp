// SPDX-License-Identifier: Apache-2.0
#include "host/ocl/own_process.h"

#include <pthread.h>

#include <atomic>

#include "egosgm/error.h"
#include "host/ocl/opencl.h"

namespace egosgm::ocl {
namespace {

std::atomic<bool> forked{false};

}  // namespace

void expect_own_process(const std::string& stage) {
  [[maybe_unused]] static const int registered = ::pthread_atfork(nullptr, nullptr, [] { forked = true; });
  if (!forked) return;
  throw DeviceError(CL_INVALID_OPERATION,
                    stage +
                        ": this process was forked from one that used OpenCL, and has not got the driver's threads: "
                        "fork before the first use, or start processes anew (in Python: "
                        "multiprocessing.get_context(\"spawn\"))");
}

bool is_forked() { return forked; }

}  // namespace egosgm::ocl
