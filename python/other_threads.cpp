// SPDX-License-Identifier: Apache-2.0
#include "python/other_threads.h"

#include <pthread.h>

#include <atomic>
#include <thread>

namespace egosgm::python {
namespace {

namespace py = pybind11;

std::atomic<int> without_lock{0};  // calls that have let go of the interpreter's lock
bool is_ending = false;            // under the interpreter's lock, as the next one
std::thread::id ending_thread;

void wait_for_calls() {
  is_ending = true;
  ending_thread = std::this_thread::get_id();
  const py::gil_scoped_release others_come_back;
  for (int calls; (calls = without_lock) > 0;) without_lock.wait(calls);
}

}  // namespace

void end_with_interpreter() {
  if (!is_ending || std::this_thread::get_id() == ending_thread) return;
  PyErr_SetNone(PyExc_SystemExit);
  throw py::error_already_set();
}

OtherThreadsRun::OtherThreadsRun() {
  end_with_interpreter();
  ++without_lock;
  released_.emplace();
}

OtherThreadsRun::~OtherThreadsRun() {
  released_.reset();
  --without_lock;
  without_lock.notify_all();
}

void bind_end(py::module_& /*module*/) {
  // Other threads' calls stay in the process that was forked.
  ::pthread_atfork(nullptr, nullptr, [] { without_lock = 0; });
  py::module_::import("atexit").attr("register")(py::cpp_function(&wait_for_calls));
}

}  // namespace egosgm::python
