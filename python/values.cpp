// SPDX-License-Identifier: Apache-2.0
// Inputs of a pipeline: calibration, motion, device, options.
#include <pybind11/stl.h>

#include "egosgm/calibration.h"
#include "egosgm/device.h"
#include "egosgm/motion.h"
#include "egosgm/named_options.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/option_values.h"
#include "python/pickling.h"

namespace egosgm::python {
namespace {

Motion make_motion(const py::object& current_from_previous, const py::object& covariance) {
  Motion motion{.current_from_previous = transform_of(current_from_previous, "current_from_previous")};
  if (!covariance.is_none()) {
    const auto values = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(covariance);
    if (!values || values.ndim() != 2 || values.shape(0) != 6 || values.shape(1) != 6) {
      PyErr_Clear();
      throw InvalidArgument("covariance: give a 6x6 matrix of (translation [m], rotation [rad])");
    }
    motion.covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(values.data());
  }
  motion.validate();
  return motion;
}

py::array_t<double> array_of_covariance(const Motion& motion) {
  py::array_t<double> array({6, 6});
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(array.mutable_data()) = motion.covariance;
  return array;
}

Calibration make_calibration(const py::object& fx, const py::object& fy, const py::object& cx, const py::object& cy,
                             const py::object& baseline_m, double doffs_px) {
  const auto number = [](const py::object& value) {
    try {
      return value.cast<double>();
    } catch (const py::cast_error&) {  // a matrix, or nothing
      throw InvalidArgument(
          "calibration: give the numbers fx, fy, cx, cy [px] and baseline_m [m]; of a camera matrix K these are "
          "K[0, 0], K[1, 1], K[0, 2], K[1, 2], and the distance of both cameras");
    }
  };
  const Calibration calibration{number(fx), number(fy), number(cx), number(cy), number(baseline_m), doffs_px};
  calibration.validate();
  return calibration;
}

std::string repr_of(const Calibration& c) {
  return py::str("Calibration(fx={}, fy={}, cx={}, cy={}, baseline_m={}, doffs_px={})")
      .format(c.fx, c.fy, c.cx, c.cy, c.baseline_m, c.doffs_px);
}

std::vector<DeviceInfo> devices() {
  std::vector<DeviceInfo> list;
  for (const Device& device : Device::list()) list.push_back(device.info());
  return list;
}

}  // namespace

void bind_values(py::module_& module) {
  py::class_<Calibration>(module, "Calibration",
                          "A rectified stereo pair. Disparity is d = x_left - x_right [px], depth is "
                          "fx * baseline_m / (d + doffs_px) [m].")
      .def(py::init(&make_calibration), py::arg("fx"), py::arg("fy") = py::none(), py::arg("cx") = py::none(),
           py::arg("cy") = py::none(), py::arg("baseline_m") = py::none(), py::arg("doffs_px") = 0.0)
      .def_readonly("fx", &Calibration::fx, "Focal length [px].")
      .def_readonly("fy", &Calibration::fy, "Focal length [px].")
      .def_readonly("cx", &Calibration::cx, "Principal point of the left camera [px].")
      .def_readonly("cy", &Calibration::cy, "Principal point of the left camera [px].")
      .def_readonly("baseline_m", &Calibration::baseline_m, "The right camera stands at (baseline_m, 0, 0) [m].")
      .def_readonly("doffs_px", &Calibration::doffs_px, "cx_right - cx [px].")
      .def("__repr__", &repr_of);

  py::class_<Motion>(module, "Motion",
                     "How the left camera moved: a 4x4 matrix that takes a point from the previous left camera's frame "
                     "(x right, y down, z forward, metres) to the current one's.")
      .def(py::init(&make_motion), py::arg("current_from_previous"), py::arg("covariance") = py::none())
      .def_property_readonly("current_from_previous",
                             [](const Motion& motion) { return array_of(motion.current_from_previous); })
      .def_property_readonly("covariance", &array_of_covariance,
                             "6x6, of (translation [m], rotation [rad]); zero where it is not known.");

  auto info = py::class_<DeviceInfo>(module, "DeviceInfo", "What an OpenCL device says of itself.");
  pickle_members<&DeviceInfo::name, &DeviceInfo::type, &DeviceInfo::vendor, &DeviceInfo::platform, &DeviceInfo::version,
                 &DeviceInfo::driver, &DeviceInfo::compute_units, &DeviceInfo::memory_bytes,
                 &DeviceInfo::max_allocation_bytes, &DeviceInfo::lacks>(info);
  info.def_readonly("name", &DeviceInfo::name)
      .def_property_readonly("type", [](const DeviceInfo& info) { return to_string(info.type); })
      .def_readonly("vendor", &DeviceInfo::vendor)
      .def_readonly("platform", &DeviceInfo::platform)
      .def_readonly("version", &DeviceInfo::version)
      .def_readonly("driver", &DeviceInfo::driver)
      .def_readonly("compute_units", &DeviceInfo::compute_units)
      .def_readonly("memory_bytes", &DeviceInfo::memory_bytes)
      .def_readonly("max_allocation_bytes", &DeviceInfo::max_allocation_bytes)
      .def("__repr__",
           [](const DeviceInfo& info) { return "<DeviceInfo '" + info.name + "' (" + to_string(info.type) + ")>"; });
  module.def("devices", &devices, py::call_guard<py::gil_scoped_release>(),
             "All OpenCL devices, in the order in which they are preferred.");
  module.def(
      "pipeline_options",
      [](const std::string& preset, const py::kwargs& values) {
        PipelineOptions options = options_of_preset(preset);
        set_options(options, values);
        options.validate();
        return dict_of(options);
      },
      py::arg("preset") = "default",
      "All options of Pipeline by name, with the values of a preset, and those that are given.");
  module.def(
      "_option_texts",
      [] {
        py::list texts;
        for (const OptionText& t : option_texts()) {
          texts.append(py::make_tuple(t.name, t.meaning, t.unit, t.range, t.when_to_change));
        }
        return texts;
      },
      "Name, meaning, unit, range and when to change, of every option of Pipeline.");
}

}  // namespace egosgm::python
