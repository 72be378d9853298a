// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/moving_objects.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <mutex>

#include "python/arrays.h"
#include "python/bindings.h"

namespace egosgm::python {
namespace {

using vision::LabelledObjects;
using vision::MovingObject;
using vision::ObjectTracker;
using vision::SceneFlow;

/// One frame after the other, also where several Python threads call.
class LockedTracker {
 public:
  explicit LockedTracker(const Calibration& calibration) : tracker_(calibration) {}

  LabelledObjects process(const py::object& left, const py::object& disparity, const py::object& dynamic,
                          const std::optional<Motion>& motion) {
    py::array keep;
    const vision::Image image = mat_of(left, "left"), map = map_of(disparity, "disparity", keep),
                        marks = mat_of(dynamic, "dynamic");
    const py::gil_scoped_release other_threads_run;
    const std::lock_guard one_at_a_time(mutex_);
    return tracker_.process(image, map, marks, motion);
  }

  std::optional<SceneFlow> scene_flow() const {
    const py::gil_scoped_release other_threads_run;
    const std::lock_guard one_at_a_time(mutex_);
    return tracker_.scene_flow();
  }

 private:
  mutable std::mutex mutex_;
  ObjectTracker tracker_;
};

}  // namespace

void bind_moving_objects(py::module_& module) {
  py::class_<MovingObject>(module, "MovingObject", "A rigid surface that moves by itself.")
      .def_readonly("id", &MovingObject::id, "1 to 255; kept while each frame finds the object.")
      .def_readonly("age", &MovingObject::age, "Pairs of frames that found it, one after the other.")
      .def_readonly("pixels", &MovingObject::pixels, "That have its label.")
      .def_property_readonly("box", &box_of<MovingObject>,
                             "[left, top, right, bottom] of its pixels, all four within it.")
      .def_property_readonly(
          "centre_m", [](const MovingObject& o) { return values_of(o.centre_m); },
          "Of its visible surface, in the camera's frame.")
      .def_property_readonly(
          "velocity_m", [](const MovingObject& o) { return values_of(o.velocity_m); },
          "Of the centre per frame, without the camera's motion, in the camera's frame.")
      .def_property_readonly(
          "velocity_sigma_m",
          [](const MovingObject& o) { return values_of(o.velocity_covariance_m2.diagonal().cwiseSqrt()); },
          "Standard deviation of each component.")
      .def_property_readonly(
          "current_from_previous", [](const MovingObject& o) { return array_of(o.current_from_previous); },
          "Moves its points from the last camera's frame to the newest one's.")
      .def("__repr__", [](const MovingObject& o) {
        return "<MovingObject " + std::to_string(o.id) + ": " + std::to_string(o.pixels) + " pixels, age " +
               std::to_string(o.age) + ">";
      });

  py::class_<LabelledObjects>(module, "LabelledObjects", "The objects of a frame.")
      .def_readonly("moving", &LabelledObjects::moving)
      .def_property_readonly(
          "labels", [](const LabelledObjects& f) { return array_of(f.labels); },
          "The object's id at each pixel of the left view, or 0.");

  auto scene_flow = py::class_<SceneFlow>(
      module, "SceneFlow",
      "Where the pixels of the frame before the newest one lie in the newest one, at that frame's pixels.");
  bind_images(scene_flow, {{"disparity", &SceneFlow::disparity},
                           {"next_disparity", &SceneFlow::next_disparity},
                           {"flow", &SceneFlow::flow},
                           {"labels", &SceneFlow::labels}});
  scene_flow.def_readonly("moving", &SceneFlow::moving, "With boxes, centres and velocities in the earlier frame.")
      .def_readonly("camera", &SceneFlow::camera, "The camera's motion from the earlier frame to the newest one.");

  py::class_<LockedTracker>(module, "ObjectTracker",
                            "Follows what moves by itself over the frames of a stereo video. Threads that share one "
                            "take turns.")
      .def(py::init<const Calibration&>(), py::arg("calibration"))
      .def(
          "process", &LockedTracker::process, py::arg("left"), py::arg("disparity"), py::arg("dynamic"),
          py::arg("motion"),
          "The next frame: its left image, the pipeline's maps `disparity` and `dynamic`, and the camera's motion from "
          "the frame before, or None: then all objects end.")
      .def(
          "scene_flow", &LockedTracker::scene_flow,
          "From the frame before to the newest one; None where the newest one came without a motion, or is the first.");
}

}  // namespace egosgm::python
