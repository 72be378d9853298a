// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace egosgm::ocl {

/// To be called before OpenCL is entered. Throws DeviceError, naming `stage`, in a process that was forked from one
/// that had called this: the driver's threads stayed there, so that the driver would wait for them without an end.
void expect_own_process(const std::string& stage);

/// Whether expect_own_process throws.
bool is_forked();

}  // namespace egosgm::ocl
