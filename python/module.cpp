// SPDX-License-Identifier: Apache-2.0
#include <pybind11/numpy.h>

#include "egosgm/error.h"
#include "egosgm/image.h"
#include "egosgm/vision/calibration_io.h"
#include "python/bindings.h"
#include "python/other_threads.h"

namespace egosgm::python {

namespace py = pybind11;

void bind_errors(py::module_& module) {
  const py::exception<Error> error(module, "Error");
  error.doc() = "What all errors of this library have in common.";
  const auto also = [&](PyObject* builtin) { return py::make_tuple(error, py::handle(builtin)); };
  py::register_exception<InvalidArgument>(module, "InvalidArgument", also(PyExc_ValueError)).doc() =
      "What the caller gave cannot be used: an image, a calibration, an option, a file. The text names the value and "
      "the remedy.";
  py::register_exception<IoError>(module, "IoError", also(PyExc_OSError)).doc() =
      "The file system refused to take a result. What stood under the file's name before stands there still.";
  auto device_error = py::register_exception<DeviceError>(module, "DeviceError", also(PyExc_RuntimeError));
  device_error.doc() = "The device or its driver refused. The text names the stage and the OpenCL status.";
  py::register_exception<vision::NegativeBaseline>(module, "_NegativeBaseline", module.attr("InvalidArgument"));
  // Asked before the others, as the last to be registered.
  py::register_exception<BuildError>(module, "BuildError", device_error).doc() =
      "A kernel did not compile. The text ends with the compiler's log.";
}

}  // namespace egosgm::python

PYBIND11_MODULE(_egosgm, module) {
  using namespace egosgm::python;
  module.attr("__version__") = EGOSGM_VERSION;
  module.attr("INVALID_DISPARITY") = egosgm::kInvalidDisparity;
  // pybind11 asks for NumPy's functions when it first needs them, and two threads that do so at once wait for each
  // other: before 2.12 with a lock of C++ and Python's.
  pybind11::dtype::of<float>();
  bind_end(module);
  bind_errors(module);
  bind_values(module);
  bind_pipeline(module);
  bind_odometry(module);
  bind_examination(module);
  bind_program(module);
  bind_files(module);
  bind_evaluation(module);
}
