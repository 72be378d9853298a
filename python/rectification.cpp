// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/rectification.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cstring>
#include <filesystem>

#include "egosgm/error.h"
#include "host/vision/doubt.h"
#include "host/vision/examination.h"
#include "host/vision/pose_doubt.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/other_threads.h"

namespace egosgm::python {
namespace {

using vision::Rectification;
using vision::StereoRig;
using Numbers = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// A copy in OpenCV's form; numbers in a row become a column.
cv::Mat matrix_of(const Numbers& numbers) {
  if (numbers.ndim() < 1 || numbers.ndim() > 2 || numbers.size() == 0 || numbers.size() > 64) {
    throw InvalidArgument("a rig's matrices have 1 or 2 dimensions and at most 64 numbers");
  }
  const int rows = static_cast<int>(numbers.shape(0)), cols = static_cast<int>(numbers.size()) / rows;
  return cv::Mat(rows, cols, CV_64F, const_cast<double*>(numbers.data())).clone();
}

StereoRig rig_of(const Numbers& left_matrix, const Numbers& left_distortion, const Numbers& right_matrix,
                 const Numbers& right_distortion, const Numbers& R, const Numbers& T, bool is_fisheye,
                 const std::optional<std::pair<int, int>>& size) {
  StereoRig rig;
  rig.left = {matrix_of(left_matrix), matrix_of(left_distortion)};
  rig.right = {matrix_of(right_matrix), matrix_of(right_distortion)};
  rig.is_fisheye = is_fisheye;
  rig.R = matrix_of(R);
  rig.T = matrix_of(T);
  if (size) rig.size = cv::Size(size->first, size->second);
  return rig;
}

py::tuple tuple_of(const cv::Rect& r) { return py::make_tuple(r.x, r.y, r.width, r.height); }

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

py::tuple rectified(const Rectification& rectification, const py::object& left, const py::object& right) {
  cv::Mat both[] = {mat_of(left, "left"), mat_of(right, "right")};
  {
    const OtherThreadsRun other_threads_run;
    both[0] = vision::rectify(both[0], rectification.left_map);
    both[1] = vision::rectify(both[1], rectification.right_map);
  }
  return py::make_tuple(array_of(both[0]), array_of(both[1]));
}

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

void bind_rectification(py::module_& module) {
  py::class_<StereoRig>(module, "StereoRig",
                        "Two cameras as OpenCV calibrates them: matrices 3x3 [px], distortion of 4, 5, 8, 12 or 14 "
                        "coefficients (4 of a\nfisheye); a point of the left camera's frame lies at R x + T [m] in the "
                        "right one's. size: (width, height) of the\ncalibrated images.")
      .def(py::init(&rig_of), py::arg("left_matrix"), py::arg("left_distortion"), py::arg("right_matrix"),
           py::arg("right_distortion"), py::arg("R"), py::arg("T"), py::arg("is_fisheye") = false,
           py::arg("size") = py::none())
      .def_readonly("is_fisheye", &StereoRig::is_fisheye)
      .def_property_readonly("size", [](const StereoRig& rig) -> py::object {
        if (!rig.size) return py::none();
        return py::make_tuple(rig.size->width, rig.size->height);
      });
  module.def("read_opencv_rig", &vision::read_opencv_rig, py::arg("file"), py::arg("unit_m") = 1.0,
             py::arg("is_fisheye") = false,
             "Reads OpenCV's stereo calibration (M1, D1, M2, D2, R, T; YAML, XML or JSON). unit_m: metres in a unit of "
             "T. None where\nthe file is of another kind.");
  module.def("read_euroc_rig", &vision::read_euroc_rig, py::arg("mav0"),
             "Reads cam0/sensor.yaml and cam1/sensor.yaml of an EuRoC sequence.");

  py::class_<Rectification>(module, "Rectification",
                            "How raw images of a rig, width x height, become rectified ones of the same size. alpha 0: "
                            "only pixels that the raw\nimages have, to 1: all that they have. Threads may share one.")
      .def(py::init([](const StereoRig& rig, int width, int height, double alpha) {
             const OtherThreadsRun other_threads_run;
             return vision::rectification_of(rig, {width, height}, alpha);
           }),
           py::arg("rig"), py::arg("width"), py::arg("height"), py::arg("alpha") = 0.0)
      .def("rectify", &rectified, py::arg("left"), py::arg("right"),
           "Both images rectified, of their types; grey, uint8 or uint16.")
      .def_readonly("calibration", &Rectification::calibration, "Of the rectified images.")
      .def_property_readonly(
          "valid", [](const Rectification& r) { return array_of(r.valid); },
          "255 where the rectified left pixel lies in the raw image, else 0.")
      .def_property_readonly(
          "valid_left", [](const Rectification& r) { return tuple_of(r.valid_left); },
          "The largest rectangle of such pixels: x, y, width, height [px].")
      .def_property_readonly("valid_right", [](const Rectification& r) { return tuple_of(r.valid_right); });
  bind_doubts(module);
  module.def("match_pair", &matches_of, py::arg("left"), py::arg("right"),
             "Points found in both images, in any rows: (N, 4) of x_left, y_left, x_right, y_right [px]. Rectified "
             "images have them in\nequal rows.");
}

}  // namespace egosgm::python
