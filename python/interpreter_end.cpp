// SPDX-License-Identifier: Apache-2.0
#include "python/interpreter_end.h"

#include <pthread.h>

#include <atomic>
#include <thread>

namespace egosgm::python {
namespace {

namespace py = pybind11;

PyCFunction of_pybind11 = nullptr;  // what Python calls for each bound function, before it is counted
std::atomic<int> under_way{0};
bool is_ending = false;  // under the interpreter's lock, as the next one
std::thread::id ending_thread;

template <typename Function>
Function as(PyCFunction function) {
  return reinterpret_cast<Function>(reinterpret_cast<void (*)()>(function));
}

/// From before the arguments are converted until after the result is: both may run Python's code.
template <typename... Arguments>
PyObject* call(PyObject* self, Arguments... arguments) {
  if (is_ending && std::this_thread::get_id() != ending_thread) {
    PyErr_SetNone(PyExc_SystemExit);
    return nullptr;
  }
  ++under_way;
  PyObject* result = as<PyObject* (*)(PyObject*, Arguments...)>(of_pybind11)(self, arguments...);
  --under_way;
  under_way.notify_all();
  return result;
}

PyMethodDef* definition_of(const py::handle& function) {
  return PyCFunction_Check(function.ptr()) ? reinterpret_cast<PyCFunctionObject*>(function.ptr())->m_ml : nullptr;
}

void count(const py::object& member) {
  PyMethodDef* definition = definition_of(py::getattr(member, "__func__", member));  // within a method
  if (!definition || definition->ml_meth != of_pybind11) return;
  const bool is_fast = definition->ml_flags & METH_FASTCALL;
  auto* counted = is_fast ? reinterpret_cast<void (*)()>(&call<PyObject* const*, Py_ssize_t, PyObject*>)
                          : reinterpret_cast<void (*)()>(&call<PyObject*, PyObject*>);
  definition->ml_meth = reinterpret_cast<PyCFunction>(counted);
}

void count_members(const py::object& owner) {
  for (const auto& [name, value] : py::dict(owner.attr("__dict__"))) {
    const auto member = py::reinterpret_borrow<py::object>(value);
    if (PyType_Check(member.ptr())) {
      count_members(member);
    } else {
      count(member);
      count(py::getattr(member, "fget", py::none()));  // of a property
    }
  }
}

void wait_for_calls() {
  is_ending = true;
  ending_thread = std::this_thread::get_id();
  const py::gil_scoped_release others_come_back;
  for (int calls; (calls = under_way) > 0;) under_way.wait(calls);
}

}  // namespace

void count_calls(const py::module_& module) {
  const py::cpp_function at_end(&wait_for_calls);
  of_pybind11 = definition_of(at_end)->ml_meth;
  count_members(module);
  // Other threads' calls stay in the process that was forked.
  ::pthread_atfork(nullptr, nullptr, [] { under_way = 0; });
  py::module_::import("atexit").attr("register")(at_end);
}

}  // namespace egosgm::python
