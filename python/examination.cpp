// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include "egosgm/options.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "vision/coarse_map.h"
#include "vision/grey_bytes.h"
#include "vision/input_check.h"
#include "vision/mosaic.h"

namespace egosgm::python {
namespace {

using vision::InputCheck;

/// Names with a line before them: the package's own.
void bind_images(py::module_& module) {
  module.def(
      "_coarse_map",
      [](const py::object& left, const py::object& right, double row_offset_px, int least, int end) {
        const vision::Image left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
        vision::Image map;
        {
          const py::gil_scoped_release other_threads_run;
          map = vision::coarse_map(left_image, right_image, row_offset_px, least, end);
        }
        return array_of(map);
      },
      py::arg("left"), py::arg("right"), py::arg("row_offset_px"), py::arg("least"), py::arg("end"),
      "Disparities [px] of images made smaller, over the full range; NaN where nothing is sure.");
  module.def(
      "_grey_bytes",
      [](const py::object& left, const py::object& right) {
        const auto [left_bytes, right_bytes] = vision::bytes_of(mat_of(left, "left"), mat_of(right, "right"));
        return py::make_tuple(array_of(left_bytes), array_of(right_bytes));
      },
      py::arg("left"), py::arg("right"), "A pair as uint8, as the odometry sees it.");
  module.def(
      "_holds_mosaic", [](const py::object& grey) { return vision::holds_mosaic(mat_of(grey, "grey")); },
      py::arg("grey"), "Whether a uint8 image is the mosaic of a colour sensor.");
  module.def(
      "_holds_swapped_bytes", [](const py::object& grey) { return vision::holds_swapped_bytes(mat_of(grey, "grey")); },
      py::arg("grey"), "Whether the two bytes of each pixel of a uint16 image are exchanged.");
  module.def(
      "_check_range",
      [](int disparities, int min_disparity) {
        PipelineOptions options;
        options.disparities = disparities, options.min_disparity = min_disparity;
        options.validate();
      },
      py::arg("disparities"), py::arg("min_disparity"));
}

void bind_input_check(py::module_& module) {
  py::class_<InputCheck>(module, "_InputCheck")
      .def(py::init([](const std::optional<Calibration>& calibration, int min_disparity, int disparities) {
             PipelineOptions options;
             options.min_disparity = min_disparity;
             options.disparities = disparities;
             return InputCheck(calibration, options);
           }),
           py::arg("calibration"), py::arg("min_disparity"), py::arg("disparities"))
      .def(
          "add",
          [](InputCheck& self, const py::object& left, const py::object& right, const FrameReport& report,
             bool has_motion) {
            const vision::Image left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
            const py::gil_scoped_release other_threads_run;
            self.add(left_image, right_image, report, has_motion);
          },
          py::arg("left"), py::arg("right"), py::arg("report"), py::arg("has_motion"))
      .def("text", &InputCheck::text);
  py::class_<vision::Suspicion>(module, "_Suspicion")
      .def_readonly("what", &vision::Suspicion::what)
      .def_readonly("remedy", &vision::Suspicion::remedy)
      .def_readonly("is_certain", &vision::Suspicion::is_certain);
  module.def("_suspect_calibration", [](const Calibration& calibration, int width, int height) {
    return vision::suspect_calibration(calibration, {width, height});
  });
  module.def("_suspect_baseline", &vision::suspect_baseline, py::arg("baseline_m"), py::arg("fx"));
}

}  // namespace

void bind_examination(py::module_& module) {
  bind_images(module);
  bind_input_check(module);
}

}  // namespace egosgm::python
