// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>

#include "host/ocl/context.h"
#include "host/ocl/own_process.h"

namespace egosgm::ocl {

/// "CL_OUT_OF_RESOURCES", or the number of a status that has no name here.
std::string status_name(int status);

/// The remedy where `platform` may have failed for its cache on the disk; empty where it has none.
std::string cache_remedy(const std::string& platform);

/// Throws the DeviceError for an OpenCL call that failed in `stage`.
[[noreturn]] void raise(const std::string& stage, const cl::Error& error);

/// Calls `f`; cl::Error leaves as DeviceError, named by what the context was doing. The public edge.
template <typename F>
auto translated(const Context& context, F&& f) {
  try {
    return std::forward<F>(f)();
  } catch (const cl::Error& error) {
    raise(context.stage(), error);
  }
}

/// Translates errors before there is a context, in a process that may use OpenCL.
template <typename F>
auto translated(const std::string& stage, F&& f) {
  expect_own_process(stage);
  try {
    return std::forward<F>(f)();
  } catch (const cl::Error& error) {
    raise(stage, error);
  }
}

}  // namespace egosgm::ocl
