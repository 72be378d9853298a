// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <pybind11/pybind11.h>

#include <optional>

namespace egosgm::python {

/// While it lives, other Python threads run, as with pybind11's gil_scoped_release. The interpreter's end waits for it:
/// Python would end a thread that comes back later in the middle of C++, which aborts the process. Once the interpreter
/// ends, a thread that makes another one ends there (SystemExit, which Python does not show).
class OtherThreadsRun {
 public:
  OtherThreadsRun();
  ~OtherThreadsRun();
  OtherThreadsRun(const OtherThreadsRun&) = delete;
  OtherThreadsRun& operator=(const OtherThreadsRun&) = delete;

 private:
  std::optional<pybind11::gil_scoped_release> released_;
};

/// Ends the calling thread, which has the interpreter's lock, where the interpreter ends.
void end_with_interpreter();

void bind_end(pybind11::module_& module);

}  // namespace egosgm::python
