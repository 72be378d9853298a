// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/evaluation.h"

#include <pybind11/operators.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <limits>

#include "apps/run_folder.h"
#include "apps/truth_pairs.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/render.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "vision/disparity_figures.h"
#include "vision/estimate_reader.h"
#include "vision/image_values.h"
#include "vision/pair_with_truth.h"

namespace egosgm::python {
namespace {

using vision::DisparityCounts;
using vision::DisparityMetrics;

DisparityCounts compare(const py::object& estimate, const py::object& truth) {
  py::array keep_estimate, keep_truth;
  const vision::Image estimated = map_of(estimate, "estimate", keep_estimate),
                      wanted = map_of(truth, "truth", keep_truth);
  const py::gil_scoped_release other_threads_run;
  return vision::compare_disparity(estimated, wanted);
}

/// A picture or map made of one map.
template <typename Function>
py::array of_map(const py::object& map, Function&& function) {
  py::array keep;
  return array_of(function(map_of(map, "disparity", keep)));
}

py::array color_disparity(const py::object& disparity, std::optional<double> low, std::optional<double> high) {
  return of_map(disparity, [&](const vision::Image& map) {
    vision::ColorRange range = vision::disparity_range(map);
    if (low) range.low = *low;
    if (high) range.high = *high;
    return vision::color_disparity(map, range);
  });
}

/// Makes a property of each member that `for_each` visits, and takes their values to other processes.
template <typename Value, typename ForEach>
py::class_<Value> bind_figures(py::module_& module, const char* name, const char* text, ForEach for_each) {
  py::class_<Value> bound(module, name, text);
  for_each([&](const char* of, auto member, const char* meaning) { bound.def_readonly(of, member, meaning); });
  bound.def(py::pickle(
      [for_each](const Value& value) {
        py::list stored;
        for_each([&](auto, auto member, auto) { stored.append(value.*member); });
        return py::tuple(stored);
      },
      [for_each](const py::tuple& stored) {
        Value value;
        std::size_t i = 0;
        for_each([&](auto, auto member, auto) {
          value.*member = stored[i++].template cast<std::decay_t<decltype(value.*member)>>();
        });
        return value;
      }));
  return bound;
}

void bind_disparity(py::module_& module) {
  bind_figures<DisparityCounts>(
      module, "DisparityCounts",
      "What comparing a disparity map with its truth counted; those of several images add up.",
      [](auto&& visit) { vision::for_each_count(visit); })
      .def(py::init<>())
      .def("__add__", [](DisparityCounts a, const DisparityCounts& b) { return a += b; })
      .def_property_readonly("metrics", &vision::metrics_of, "The figures in percent.");
  bind_figures<DisparityMetrics>(module, "DisparityMetrics",
                                 "Percent of the pixels with truth; bad: off by more than 3 px (KITTI).",
                                 [](auto&& visit) { vision::for_each_metric(visit); });
  module.def("compare_disparity", &compare, py::arg("estimate"), py::arg("truth"),
             "Compares two H x W maps over the pixels that have truth, as KITTI's development kits do.");
  module.def(
      "_disparity_map",
      [](const py::object& map, const char* name) {
        py::array keep;
        map_of(map, name, keep);
        return keep;
      },
      py::arg("map"), py::arg("name"));
  module.def("mean_of", &vision::mean_of, py::arg("images"), "The mean of each image's figures (KITTI 2012).");
}

/// Binds what the commands eval-video and eval-poses share with eval: which files belong together, and what they hold.
void bind_estimates(py::module_& module) {
  using std::filesystem::path;
  using vision::EstimateReader;
  py::class_<vision::EvaluationPair>(module, "_EvaluationPair")
      .def_readonly("estimate", &vision::EvaluationPair::estimate)
      .def_readonly("truth", &vision::EvaluationPair::truth)
      .def_property_readonly("name", [](const vision::EvaluationPair& pair) { return text_of(pair.name); })
      .def_readonly("same_name", &vision::EvaluationPair::same_name);
  module.def(
      "_pair_with_truth",
      [](const path& estimate, const path& truth, const std::string& frames) {
        const auto found = app::find_truth_pairs(estimate, truth, frames);
        return py::make_tuple(found.pairs, found.without_estimate, found.without_truth);
      },
      py::arg("estimate"), py::arg("truth"), py::arg("frames"));
  module.def("_frames_of_run", &app::frames_of_run, py::arg("path"));
  module.def(
      "_list_maps",
      [](const path& estimate, const std::string& frames) { return vision::list_maps(estimate, range_of(frames)); },
      py::arg("estimate"), py::arg("frames"));
  py::class_<EstimateReader>(module, "_EstimateReader")
      .def(py::init<>())
      .def(
          "read",
          [](EstimateReader& reader, const path& file, double scale) { return array_of(reader.read(file, scale)); },
          py::arg("file"), py::arg("scale"))
      .def(
          "compare",
          [](EstimateReader& reader, const py::object& estimate, const py::object& truth) {
            py::array keep_estimate, keep_truth;
            reader.compare(map_of(estimate, "estimate", keep_estimate), map_of(truth, "truth", keep_truth));
          },
          py::arg("estimate"), py::arg("truth"))
      .def(
          "warnings",
          [](const EstimateReader& reader, double scale, double truth_scale) {
            py::list warnings;
            for (const std::string& warning : reader.warnings(scale, truth_scale)) warnings.append(text_of(warning));
            return warnings;
          },
          py::arg("scale"), py::arg("truth_scale"));
  module.def(
      "_parse_frame_range",
      [](const std::string& frames) {
        const vision::FrameRange range = range_of(frames);
        return std::pair(range.first, range.last);
      },
      py::arg("frames"));
  module.def("_expect_scaled", &vision::expect_scaled, py::arg("option"), py::arg("scale"), py::arg("file"));
  module.def(
      "_read_scaled", [](const path& file, double scale) { return array_of(vision::read_scaled(file, scale)); },
      py::arg("file"), py::arg("scale"));
  module.def(
      "_read_values", [](const path& file) { return array_of(vision::read_values(file)); }, py::arg("file"));
  module.def(
      "_poses_of_frames",
      [](const vision::StereoSequence& sequence, const path& file) {
        return array_of(vision::poses_of_frames(sequence, file));
      },
      py::arg("sequence"), py::arg("file"));
  module.def(
      "_rows_of_frames",
      [](const std::vector<int>& frames, const std::vector<int>& numbers, std::size_t rows, const path& file,
         const std::string& what) {
        vision::StereoSequence sequence;
        for (const int number : frames) sequence.frames.emplace_back().number = number;
        sequence.numbers = numbers;
        return vision::rows_of_frames(sequence, rows, file, what);
      },
      py::arg("frames"), py::arg("numbers"), py::arg("rows"), py::arg("file"), py::arg("what"));
}

}  // namespace

void bind_evaluation(py::module_& module) {
  bind_disparity(module);
  bind_estimates(module);
  module.def(
      "interpolate_background", [](const py::object& map) { return of_map(map, vision::interpolate_background); },
      py::arg("disparity"), "Fills the holes from the background, as KITTI's development kit does.");
  module.def(
      "depth_from_disparity",
      [](const py::object& map, const Calibration& calibration) {
        return of_map(map, [&](const vision::Image& mat) {
          vision::Image depth_m = vision::depth_from_disparity(mat, calibration);
          vision::set_where(depth_m, std::numeric_limits<float>::quiet_NaN(), depth_m,
                            [](auto value) { return value <= 0; });
          return depth_m;
        });
      },
      py::arg("disparity"), py::arg("calibration"),
      "Depth [m] = fx * baseline_m / (disparity + doffs_px); NaN where there is no disparity, and where depth has no "
      "end.");
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
