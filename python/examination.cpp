// SPDX-License-Identifier: Apache-2.0
#include "host/vision/examination.h"

#include <pybind11/stl.h>

#include "host/vision/doubt.h"
#include "host/vision/pair_matches.h"
#include "host/vision/pose_doubt.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/other_threads.h"

namespace egosgm::python {
namespace {

py::array_t<float> matches_of(const py::object& left, const py::object& right) {
  const cv::Mat left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
  std::vector<vision::PairMatch> matches;
  {
    const OtherThreadsRun other_threads_run;
    matches = vision::match_pair(left_image, right_image);
  }
  py::array_t<float> rows({static_cast<py::ssize_t>(matches.size()), py::ssize_t{4}});
  for (std::size_t i = 0; i < matches.size(); ++i) {
    float* row = rows.mutable_data(static_cast<py::ssize_t>(i), 0);
    row[0] = matches[i].left.x, row[1] = matches[i].left.y, row[2] = matches[i].right.x, row[3] = matches[i].right.y;
  }
  return rows;
}

using vision::Doubt;
using vision::Examination;

py::object text_of(const std::optional<vision::Suspicion>& suspicion) {
  return suspicion ? py::object(py::str(suspicion->what + ": " + suspicion->remedy)) : py::none();
}

py::list findings_of(const Examination& examination, std::size_t pairs) {
  py::list list;
  for (const vision::Finding& finding : examination.findings(pairs)) {
    const char* verdict = finding.verdict == vision::Verdict::kFine   ? "ok"
                          : finding.verdict == vision::Verdict::kNote ? "note"
                                                                      : "problem";
    list.append(py::make_tuple(verdict, finding.check, finding.text, finding.remedy));
  }
  return list;
}

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
void bind_doubts(py::module_& module) {
  py::class_<Doubt>(module, "_Doubt")
      .def(py::init([](const std::optional<Calibration>& calibration, int min_disparity, int disparities) {
             PipelineOptions options;
             options.min_disparity = min_disparity;
             options.disparities = disparities;
             return Doubt(calibration, options);
           }),
           py::arg("calibration"), py::arg("min_disparity"), py::arg("disparities"))
      .def(
          "add",
          [](Doubt& self, const py::object& left, const py::object& right, const FrameReport& report, bool has_motion) {
            const cv::Mat left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
            const OtherThreadsRun other_threads_run;
            self.add(left_image, right_image, report, has_motion);
          },
          py::arg("left"), py::arg("right"), py::arg("report"), py::arg("has_motion"))
      .def("text", &Doubt::text);
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
  py::class_<Examination>(module, "_Examination")
      .def(py::init<const std::optional<Calibration>&, int, int>(), py::arg("calibration"), py::arg("least"),
           py::arg("end"))
      .def("add",
           [](Examination& self, const py::object& left, const py::object& right) {
             const cv::Mat left_image = mat_of(left, "left"), right_image = mat_of(right, "right");
             const OtherThreadsRun other_threads_run;
             self.add(left_image, right_image);
           })
      .def("findings", &findings_of, py::arg("pairs"));
  module.def("_suspect_calibration", [](const Calibration& calibration, int width, int height) {
    return text_of(vision::suspect_calibration(calibration, {width, height}));
  });
  module.def("_suspect_baseline",
             [](double baseline_m, double fx) { return text_of(vision::suspect_baseline(baseline_m, fx)); });
  module.def("_suspect_motions", &motions_doubt, py::arg("given"), py::arg("found"));
}

}  // namespace

void bind_examination(py::module_& module) {
  bind_doubts(module);
  module.def("match_pair", &matches_of, py::arg("left"), py::arg("right"),
             "Points found in both images, in any rows: (N, 4) of x_left, y_left, x_right, y_right [px]. Rectified "
             "images have them in\nequal rows.");
}

}  // namespace egosgm::python
