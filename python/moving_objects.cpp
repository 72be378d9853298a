// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/moving_objects.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <array>
#include <cstring>
#include <mutex>

#include "python/arrays.h"
#include "python/bindings.h"
#include "python/pickling.h"

namespace egosgm::python {

template <int kRows, int kCols>
struct Stored<Eigen::Matrix<double, kRows, kCols>> {
  using Value = Eigen::Matrix<double, kRows, kCols>;
  using Numbers = std::array<double, std::size_t{kRows} * kCols>;
  static py::object of(const Value& value) {
    Numbers numbers;
    Eigen::Map<Value>(numbers.data()) = value;
    return py::cast(numbers);
  }
  static Value from(const py::handle& stored) { return Eigen::Map<const Value>(stored.cast<Numbers>().data()); }
};

template <>
struct Stored<Isometry> {
  static py::object of(const Isometry& value) { return Stored<Eigen::Matrix4d>::of(value.matrix()); }
  static Isometry from(const py::handle& stored) { return Isometry(Stored<Eigen::Matrix4d>::from(stored)); }
};

template <>
struct Stored<vision::Image> {  // kU8, kF32 or kFlow
  static py::object of(const vision::Image& value) { return array_of(value); }
  static vision::Image from(const py::handle& stored) {
    const auto array = stored.cast<py::array>();
    const bool bytes = element_bytes(array) == 1;
    vision::Image image(static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)),
                        bytes               ? vision::kU8
                        : array.ndim() == 2 ? vision::kF32
                                            : vision::kFlow);
    const auto row_bytes = static_cast<std::size_t>(image.cols) * image.type.pixel_bytes();
    for (int y = 0; y < image.rows; ++y) {
      std::memcpy(image.row(y), static_cast<const char*>(array.data()) + y * array.strides(0), row_bytes);
    }
    return image;
  }
};

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
  auto object = py::class_<MovingObject>(module, "MovingObject", "A rigid surface that moves by itself.");
  pickle_members<&MovingObject::id, &MovingObject::age, &MovingObject::pixels, &MovingObject::left, &MovingObject::top,
                 &MovingObject::right, &MovingObject::bottom, &MovingObject::centre_m, &MovingObject::velocity_m,
                 &MovingObject::velocity_covariance_m2, &MovingObject::current_from_previous>(object);
  object.def_readonly("id", &MovingObject::id, "1 to 255; kept while each frame finds the object.")
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

  auto objects = py::class_<LabelledObjects>(module, "LabelledObjects", "The objects of a frame.");
  pickle_members<&LabelledObjects::moving, &LabelledObjects::labels>(objects);
  objects.def_readonly("moving", &LabelledObjects::moving)
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
  pickle_members<&SceneFlow::disparity, &SceneFlow::next_disparity, &SceneFlow::flow, &SceneFlow::labels,
                 &SceneFlow::moving, &SceneFlow::camera>(scene_flow);
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
