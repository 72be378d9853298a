// SPDX-License-Identifier: Apache-2.0
#include "egosgm/odometry.h"

#include <pybind11/stl.h>

#include <mutex>

#include "egosgm/vision/synthetic.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/option_values.h"
#include "python/pickling.h"

namespace egosgm {

template <typename Visit>
void for_each_field(StereoOdometryOptions& o, Visit&& visit) {
  visit("max_translation_m", o.max_translation_m);
  visit("max_rotation_deg", o.max_rotation_deg);
  visit("corner_threshold", o.corner_threshold);
  visit("max_features", o.max_features);
  visit("max_disparity_px", o.max_disparity_px);
  visit("max_flow_x_px", o.max_flow_x_px);
  visit("max_flow_y_px", o.max_flow_y_px);
  visit("learn_rectification", o.learn_rectification);
  visit("ransac_iterations", o.ransac_iterations);
  visit("inlier_threshold_px", o.inlier_threshold_px);
  visit("min_inliers", o.min_inliers);
  visit("min_inlier_ratio", o.min_inlier_ratio);
  visit("seed", o.seed);
}

namespace vision {

template <typename Visit>
void for_each_field(SyntheticOptions& o, Visit&& visit) {
  visit("frames", o.frames);
  visit("width", o.width);
  visit("height", o.height);
  visit("seed", o.seed);
  visit("plain", o.plain);
  visit("moving_object", o.moving_object);
  visit("traffic", o.traffic);
  visit("moving_object_scale", o.moving_object_scale);
  visit("speed_m", o.speed_m);
  visit("turn_deg", o.turn_deg);
  visit("wobble", o.wobble);
  visit("noise_grey", o.noise_grey);
  visit("exposure", o.exposure);
  visit("pole_width_px", o.pole_width_px);
  visit("pole_spacing_m", o.pole_spacing_m);
  visit("supersampling", o.supersampling);
}

}  // namespace vision
}  // namespace egosgm

namespace egosgm::python {

StereoOdometryOptions odometry_options_of(const py::kwargs& values) {
  StereoOdometryOptions options;
  set_fields(options, values);
  return options;
}

namespace {

using vision::SyntheticFrame;
using vision::SyntheticObject;
using vision::SyntheticSceneFlow;
using vision::SyntheticSequence;

/// One frame after the other, also where several Python threads call.
class LockedOdometry {
 public:
  LockedOdometry(const Calibration& calibration, const StereoOdometryOptions& options)
      : odometry_(calibration, options) {}

  OdometryResult process(const py::object& left, const py::object& right, const py::object& prior) {
    const ImageArray left_image = image_of(left, "left"), right_image = image_of(right, "right");
    std::optional<Eigen::Isometry3d> guess;
    if (py::isinstance<Motion>(prior)) {
      guess = prior.cast<Motion>().current_from_previous;
    } else if (!prior.is_none()) {
      guess = transform_of(prior, "prior");
    }
    const py::gil_scoped_release other_threads_run;
    const std::lock_guard one_at_a_time(mutex_);
    return odometry_.process(left_image.view, right_image.view, guess);
  }

  void reset() {
    const py::gil_scoped_release other_threads_run;
    const std::lock_guard one_at_a_time(mutex_);
    odometry_.reset();
  }

 private:
  std::mutex mutex_;
  StereoOdometry odometry_;
};

void bind_synthetic(py::module_& module) {
  auto frame = py::class_<SyntheticFrame>(module, "SyntheticFrame", "Images, exact disparities [px] and masks.");
  bind_images(frame, {{"left", &SyntheticFrame::left},
                      {"right", &SyntheticFrame::right},
                      {"left_disparity", &SyntheticFrame::left_disparity},
                      {"right_disparity", &SyntheticFrame::right_disparity},
                      {"left_noc", &SyntheticFrame::left_noc},
                      {"right_noc", &SyntheticFrame::right_noc},
                      {"left_moving", &SyntheticFrame::left_moving},
                      {"right_moving", &SyntheticFrame::right_moving}});
  frame.def_property_readonly("world_from_camera",
                              [](const SyntheticFrame& f) { return array_of(f.world_from_camera); });

  py::class_<SyntheticObject>(module, "SyntheticObject", "What moves by itself and shows in a left image.")
      .def_readonly("id", &SyntheticObject::id, "Its pixels in SyntheticSceneFlow.objects.")
      .def_property_readonly("box", &box_of<SyntheticObject>,
                             "[left, top, right, bottom] of its pixels, all four within it.")
      .def_property_readonly(
          "centre_m", [](const SyntheticObject& o) { return values_of(o.centre_m); }, "In the camera's frame.")
      .def_property_readonly(
          "velocity_m", [](const SyntheticObject& o) { return values_of(o.velocity_m); },
          "Its own, without the camera's, per frame, in the camera's frame.")
      .def_property_readonly(
          "next_from_current", [](const SyntheticObject& o) { return array_of(o.next_from_current); },
          "Moves its points from this camera's frame to the next one's.");

  auto scene_flow = py::class_<SyntheticSceneFlow>(
      module, "SyntheticSceneFlow", "Where the surfaces of a left image are one frame later, hidden ones too.");
  bind_images(scene_flow, {{"flow", &SyntheticSceneFlow::flow},
                           {"next_disparity", &SyntheticSceneFlow::next_disparity},
                           {"seen_next", &SyntheticSceneFlow::seen_next},
                           {"objects", &SyntheticSceneFlow::objects}});
  scene_flow.def_readonly("moving", &SyntheticSceneFlow::moving, "The objects with flow, by id.");

  py::class_<SyntheticSequence>(module, "SyntheticSequence",
                                "A drive through a synthetic street with exact truth; frames are rendered on demand. "
                                "Options as keyword arguments: see synthetic_options().")
      .def(py::init([](const py::kwargs& values) {
        vision::SyntheticOptions options;
        set_fields(options, values);
        return std::make_unique<SyntheticSequence>(options);
      }))
      .def("__len__", &SyntheticSequence::frames)
      .def_property_readonly("options", [](const SyntheticSequence& s) { return dict_of_fields(s.options()); })
      .def_property_readonly("calibration", &SyntheticSequence::calibration)
      .def("motion", &SyntheticSequence::motion, py::arg("frame"), "From the frame before; identity for frame 0.")
      .def("render", &SyntheticSequence::render, py::arg("frame"), py::call_guard<py::gil_scoped_release>())
      .def("scene_flow", &SyntheticSequence::scene_flow, py::arg("frame"), py::call_guard<py::gil_scoped_release>(),
           "From the frame to the one after it.");
  module.def(
      "synthetic_options", [] { return dict_of_fields(vision::SyntheticOptions{}); },
      "All options of SyntheticSequence with their defaults.");
}

}  // namespace

void bind_odometry(py::module_& module) {
  auto result = py::class_<OdometryResult>(module, "OdometryResult");
  pickle_members<&OdometryResult::motion, &OdometryResult::features, &OdometryResult::matches, &OdometryResult::inliers,
                 &OdometryResult::reprojection_rms_px, &OdometryResult::standstill, &OdometryResult::reason>(result);
  result.def_readonly("motion", &OdometryResult::motion, "From the previous frame to this one, or None.")
      .def_readonly("features", &OdometryResult::features)
      .def_readonly("matches", &OdometryResult::matches)
      .def_readonly("inliers", &OdometryResult::inliers)
      .def_readonly("reprojection_rms_px", &OdometryResult::reprojection_rms_px)
      .def_readonly("standstill", &OdometryResult::standstill, "The motion is the identity: nothing but noise.")
      .def_readonly("reason", &OdometryResult::reason, "Why there is no motion; empty where there is one.");

  py::class_<LockedOdometry>(module, "StereoOdometry",
                             "Ego-motion from rectified stereo video. Options as keyword arguments: see "
                             "odometry_options(). Threads that share one take turns.")
      .def(py::init([](const Calibration& calibration, const py::kwargs& values) {
             return std::make_unique<LockedOdometry>(calibration, odometry_options_of(values));
           }),
           py::arg("calibration"))
      .def("process", &LockedOdometry::process, py::arg("left"), py::arg("right"), py::arg("prior") = py::none(),
           "The next frame; images as Pipeline.process takes them. `prior`, a Motion or a 4x4 matrix "
           "current_from_previous, only "
           "guides the search. The first frame has no motion.")
      .def("reset", &LockedOdometry::reset, "Forgets all frames: the next one is a first frame.");
  module.def(
      "odometry_options", [] { return dict_of_fields(StereoOdometryOptions{}); },
      "All options of StereoOdometry with their defaults.");
  bind_synthetic(module);
}

}  // namespace egosgm::python
