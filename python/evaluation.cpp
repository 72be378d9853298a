// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/evaluation.h"

#include <pybind11/operators.h>
#include <pybind11/stl.h>

#include "egosgm/vision/pose_evaluation.h"
#include "egosgm/vision/render.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/other_threads.h"

namespace egosgm::python {
namespace {

using vision::DisparityCounts;
using vision::DisparityMetrics;
using vision::PoseEvaluation;
using vision::SegmentError;

DisparityCounts compare(const py::object& estimate, const py::object& truth) {
  py::array keep_estimate, keep_truth;
  const cv::Mat estimated = map_of(estimate, "estimate", keep_estimate), wanted = map_of(truth, "truth", keep_truth);
  const OtherThreadsRun other_threads_run;
  return vision::compare_disparity(estimated, wanted);
}

/// A picture or map made of one map.
template <typename Function>
py::array of_map(const py::object& map, Function&& function) {
  py::array keep;
  return array_of(function(map_of(map, "disparity", keep)));
}

py::array color_disparity(const py::object& disparity, std::optional<double> low, std::optional<double> high) {
  return of_map(disparity, [&](const cv::Mat& map) {
    vision::ColorRange range = vision::disparity_range(map);
    if (low) range.low = *low;
    if (high) range.high = *high;
    return vision::color_disparity(map, range);
  });
}

void bind_disparity(py::module_& module) {
  py::class_<DisparityCounts>(module, "DisparityCounts",
                              "What comparing a disparity map with its truth counted; those of several images add up.")
      .def(py::init<>())
      .def_readonly("truth", &DisparityCounts::truth)
      .def_readonly("valid", &DisparityCounts::valid)
      .def_readonly("bad", &DisparityCounts::bad)
      .def_readonly("d1", &DisparityCounts::d1)
      .def_readonly("bad_interpolated", &DisparityCounts::bad_interpolated)
      .def_readonly("d1_interpolated", &DisparityCounts::d1_interpolated)
      .def_readonly("absolute_error_px", &DisparityCounts::absolute_error_px)
      .def_readonly("sky", &DisparityCounts::sky, "Where the truth says that nothing is there.")
      .def_readonly("sky_valid", &DisparityCounts::sky_valid)
      .def("__add__", [](DisparityCounts a, const DisparityCounts& b) { return a += b; })
      .def_property_readonly("metrics", &vision::metrics_of, "The figures in percent.");
  py::class_<DisparityMetrics>(module, "DisparityMetrics",
                               "Percent of the pixels with truth; bad: off by more than 3 px (KITTI).")
      .def_readonly("bad_or_missing", &DisparityMetrics::bad_or_missing)
      .def_readonly("bad_of_valid", &DisparityMetrics::bad_of_valid, "Percent of the pixels with an estimate.")
      .def_readonly("density", &DisparityMetrics::density, "Percent of the pixels with a surface.")
      .def_readonly("interpolated", &DisparityMetrics::interpolated, "After background interpolation (KITTI 2012).")
      .def_readonly("d1", &DisparityMetrics::d1)
      .def_readonly("d1_interpolated", &DisparityMetrics::d1_interpolated, "KITTI 2015's official figure.")
      .def_readonly("mae_px", &DisparityMetrics::mae_px)
      .def_readonly("filled", &DisparityMetrics::filled)
      .def_readonly("wrong_of_all", &DisparityMetrics::wrong_of_all, "What is missing does not count.");
  module.def("compare_disparity", &compare, py::arg("estimate"), py::arg("truth"),
             "Compares two H x W maps over the pixels that have truth, as KITTI's development kits do.");
  module.def("mean_of", &vision::mean_of, py::arg("images"), "The mean of each image's figures (KITTI 2012).");
}

void bind_poses(py::module_& module) {
  py::class_<SegmentError>(module, "SegmentError")
      .def_readonly("length_m", &SegmentError::length_m)
      .def_readonly("segments", &SegmentError::segments)
      .def_readonly("translation_percent", &SegmentError::translation_percent)
      .def_readonly("rotation_deg_per_m", &SegmentError::rotation_deg_per_m);
  py::class_<PoseEvaluation>(module, "PoseEvaluation")
      .def_readonly("translation_mean_m", &PoseEvaluation::translation_mean_m)
      .def_readonly("rotation_mean_rad", &PoseEvaluation::rotation_mean_rad)
      .def_readonly("translation_rmse_m", &PoseEvaluation::translation_rmse_m)
      .def_readonly("rotation_rmse_rad", &PoseEvaluation::rotation_rmse_rad)
      .def_readonly("path_length_m", &PoseEvaluation::path_length_m)
      .def_readonly("end_drift_m", &PoseEvaluation::end_drift_m)
      .def_readonly("end_drift_percent", &PoseEvaluation::end_drift_percent)
      .def_readonly("rotation_end_drift_deg", &PoseEvaluation::rotation_end_drift_deg)
      .def_readonly("segments", &PoseEvaluation::segments)
      .def_readonly("short_segments", &PoseEvaluation::short_segments)
      .def_readonly("segment_translation_percent", &PoseEvaluation::segment_translation_percent)
      .def_readonly("segment_rotation_deg_per_m", &PoseEvaluation::segment_rotation_deg_per_m);
  module.def(
      "evaluate_poses",
      [](const py::object& estimate, const py::object& truth) {
        return vision::evaluate_poses(transforms_of(estimate, "estimate"), transforms_of(truth, "truth"));
      },
      py::arg("estimate"), py::arg("truth"),
      "Compares camera-to-world poses, (N, 4, 4), as KITTI's odometry kit does.");
}

}  // namespace

void bind_evaluation(py::module_& module) {
  bind_disparity(module);
  bind_poses(module);
  module.def(
      "interpolate_background", [](const py::object& map) { return of_map(map, vision::interpolate_background); },
      py::arg("disparity"), "Fills the holes from the background, as KITTI's development kit does.");
  module.def(
      "depth_from_disparity",
      [](const py::object& map, const Calibration& calibration) {
        return of_map(map, [&](const cv::Mat& mat) { return vision::depth_from_disparity(mat, calibration); });
      },
      py::arg("disparity"), py::arg("calibration"), "Depth [m]; INVALID_DISPARITY where there is none.");
  module.def("color_disparity", &color_disparity, py::arg("disparity"), py::arg("low") = py::none(),
             py::arg("high") = py::none(), "H x W x 3, RGB: turbo colours, near is red, black where invalid.");
  module.def(
      "color_error",
      [](const py::object& estimate, const py::object& truth) {
        py::array keep_estimate, keep_truth;
        return array_of(
            vision::color_error(map_of(estimate, "estimate", keep_estimate), map_of(truth, "truth", keep_truth)));
      },
      py::arg("estimate"), py::arg("truth"), "H x W x 3, RGB: |error| in steps that double, red above 3 px.");
}

}  // namespace egosgm::python
