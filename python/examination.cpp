// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>

#include <cstring>

#include "egosgm/options.h"
#include "host/vision/coarse_map.h"
#include "host/vision/doubt.h"
#include "host/vision/grey_bytes.h"
#include "host/vision/pose_doubt.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/other_threads.h"

namespace egosgm::python {
namespace {

/// A copy, as rows may lie at any stride.
cv::Mat mat_of(const py::object& image, const char* name) {
  const ImageArray owner = image_of(image, name);
  const ImageView& view = owner.view;
  cv::Mat mat(view.height, view.width, view.type == PixelType::kU8 ? CV_8UC1 : CV_16UC1);
  for (int y = 0; y < view.height; ++y) {
    std::memcpy(mat.ptr(y), static_cast<const char*>(view.data) + y * view.stride_bytes,
                static_cast<std::size_t>(view.width) * mat.elemSize());
  }
  return mat;
}

using vision::Doubt;

std::string motions_doubt(const std::vector<py::object>& given, const std::vector<py::object>& found) {
  std::vector<Eigen::Isometry3d> motions;
  std::vector<std::optional<Eigen::Isometry3d>> others;
  for (const py::object& motion : given) motions.push_back(transform_of(motion, "given"));
  for (const py::object& motion : found) {
    others.push_back(motion.is_none() ? std::nullopt : std::optional(transform_of(motion, "found")));
  }
  return vision::suspect_motions(motions, others);
}

/// Names with a line before them: the package's own.
void bind_images(py::module_& module) {
  module.def(
      "_clipped_by_range",
      [](const py::object& left, const py::object& right, int least, int end) {
        const cv::Mat left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
        std::optional<vision::Clipped> clipped;
        {
          const OtherThreadsRun other_threads_run;
          clipped = vision::clipped_by_range(left_image, right_image, least, end);
        }
        return clipped ? py::object(py::make_tuple(clipped->share, clipped->disparities)) : py::none();
      },
      py::arg("left"), py::arg("right"), py::arg("least"), py::arg("end"),
      "The share of the image that is nearer than [least, end), and the number of disparities that would do; None "
      "where hardly anything is.");
  module.def(
      "_coarse_map",
      [](const py::object& left, const py::object& right, double row_offset_px, int least, int end) {
        const cv::Mat left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
        cv::Mat map;
        {
          const OtherThreadsRun other_threads_run;
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
      "_check_range",
      [](int disparities, int min_disparity) {
        PipelineOptions options;
        options.disparities = disparities, options.min_disparity = min_disparity;
        options.validate();
      },
      py::arg("disparities"), py::arg("min_disparity"));
}

void bind_doubts(py::module_& module) {
  py::class_<Doubt>(module, "_Doubt")
      .def(py::init([](const std::optional<Calibration>& calibration, int width, int height) {
             return Doubt(calibration, {width, height});
           }),
           py::arg("calibration"), py::arg("width"), py::arg("height"))
      .def("add", &Doubt::add, py::arg("density"), py::arg("has_motion"), py::arg("holds_8_bits_in_16"))
      .def(
          "look_beyond",
          [](Doubt& self, const py::object& left, const py::object& right, int least, int end) {
            const cv::Mat left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
            const OtherThreadsRun other_threads_run;
            self.look_beyond(left_image, right_image, least, end);
          },
          py::arg("left"), py::arg("right"), py::arg("least"), py::arg("end"))
      .def("text", &Doubt::text);
  py::class_<vision::Suspicion>(module, "_Suspicion")
      .def_readonly("what", &vision::Suspicion::what)
      .def_readonly("remedy", &vision::Suspicion::remedy);
  module.def("_suspect_calibration", [](const Calibration& calibration, int width, int height) {
    return vision::suspect_calibration(calibration, {width, height});
  });
  module.def("_suspect_baseline", &vision::suspect_baseline, py::arg("baseline_m"), py::arg("fx"));
  module.def("_suspect_motions", &motions_doubt, py::arg("given"), py::arg("found"));
}

}  // namespace

void bind_examination(py::module_& module) {
  bind_images(module);
  bind_doubts(module);
}

}  // namespace egosgm::python
