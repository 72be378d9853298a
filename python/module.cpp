// SPDX-License-Identifier: Apache-2.0
#include <pybind11/numpy.h>

#include "egosgm/error.h"
#include "egosgm/image.h"
#include "egosgm/vision/calibration_io.h"
#include "python/bindings.h"
#include "python/interpreter_end.h"

namespace egosgm::python {

namespace py = pybind11;

namespace {

/// Registers an exception like py::register_exception, which takes texts of UTF-8 alone.
template <typename Exception>
py::object bind_error(py::module_& module, const char* name, const py::object& bases, const char* meaning) {
  static PyObject* kind = nullptr;  // lives as long as the interpreter
  py::exception<Exception> bound(module, name, bases.ptr());
  bound.doc() = meaning;
  kind = bound.inc_ref().ptr();
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Exception& error) {
      PyErr_SetObject(kind, text_of(error.what()).ptr());
    }
  });
  return bound;
}

}  // namespace

py::str text_of(const std::string& text) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeFSDefaultAndSize(text.data(), static_cast<py::ssize_t>(text.size())));
}

std::string text_from(const py::handle& text) {
  return py::reinterpret_steal<py::bytes>(PyUnicode_EncodeFSDefault(py::str(text).ptr()));
}

void bind_errors(py::module_& module) {
  const py::exception<Error> error(module, "Error");
  error.doc() = "What all errors of this library have in common.";
  const auto also = [&](PyObject* builtin) { return py::make_tuple(error, py::handle(builtin)); };
  bind_error<InvalidArgument>(
      module, "InvalidArgument", also(PyExc_ValueError),
      "What the caller gave cannot be used: an image, a calibration, an option, a file. The text names the value and "
      "the remedy.");
  bind_error<IoError>(
      module, "IoError", also(PyExc_OSError),
      "The file system refused to take a result. What stood under the file's name before stands there still.");
  const py::object device_error =
      bind_error<DeviceError>(module, "DeviceError", also(PyExc_RuntimeError),
                              "The device or its driver refused. The text names the stage and the OpenCL status.");
  bind_error<vision::NegativeBaseline>(module, "_NegativeBaseline", module.attr("InvalidArgument"), "");
  // Asked before the others, as the last to be registered.
  bind_error<BuildError>(module, "BuildError", device_error,
                         "A kernel did not compile. The text ends with the compiler's log.");
}

}  // namespace egosgm::python

PYBIND11_MODULE(_egosgm, module) {
  using namespace egosgm::python;
  module.attr("__version__") = EGOSGM_VERSION;
  module.attr("INVALID_DISPARITY") = egosgm::kInvalidDisparity;
  // pybind11 asks for NumPy's functions when it first needs them, and two threads that do so at once wait for each
  // other: before 2.12 with a lock of C++ and Python's.
  pybind11::dtype::of<float>();
  bind_errors(module);
  bind_values(module);
  bind_pipeline(module);
  bind_odometry(module);
  bind_moving_objects(module);
  bind_examination(module);
  bind_video(module);
  bind_program(module);
  bind_files(module);
  bind_evaluation(module);
  count_calls(module);
}
