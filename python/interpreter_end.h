// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

namespace egosgm::python {

/// Counts the calls of all functions that the module has. The interpreter's end waits for those under way: Python would
/// end a thread that asks for the interpreter's lock later in the middle of C++, which then lets go of Python's objects
/// without that lock, or aborts the process. Once the interpreter ends, another thread that calls ends there
/// (SystemExit, which Python does not show).
void count_calls(const pybind11::module_& module);

}  // namespace egosgm::python
