// SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>
#include <pybind11/stl.h>

#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "egosgm/error.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/frame.h"
#include "vision/stereo_video.h"

namespace egosgm::python {
namespace {

/// The one loop (vision/stereo_video.h) over a sequence's files, or over pairs that Python adds.
class Video {
 public:
  Video(const py::object& pipeline, int width, int height, const std::optional<Calibration>& calibration,
        std::optional<vision::StereoSequence> sequence, const py::object& outputs, int lag, bool finds_motion,
        const py::kwargs& odometry)
      : keep_pipeline_(pipeline),
        width_(width),
        height_(height),
        wanted_(outputs),
        motions_(finds_motion ? calibration : std::nullopt, odometry_options_of(odometry)) {
    const py::gil_scoped_release other_threads_run;
    if (sequence) {
      sequence->calibrated_width = 0;  // of a calibration that may not be the one that is given
      source_.emplace(std::move(*sequence));
    }
    video_.emplace(motions_, pipeline_of(pipeline),
                   vision::StereoVideoOptions{.calibration = calibration,
                                              .outputs = [this] { return make_outputs(); },
                                              .is_interrupted = {},
                                              .reads_ahead = false,
                                              .lag = lag},
                   source_ ? &*source_ : nullptr);
  }

  bool wants_pair() const { return video_->wants_pair(); }

  /// What is wrong with the pair, `next` says.
  void add(const py::object& left, const py::object& right, const py::object& pose, bool starts_anew) {
    vision::VideoPair pair;
    try {
      pair.images = {mat_of(left, "left"), mat_of(right, "right")};
      if (!pose.is_none()) pair.world_from_camera = transform_of(pose, "pose");
    } catch (const std::exception&) {
      return video_->end(std::current_exception());
    }
    pair.frame.number = pairs_++;
    pair.frame.name = fmt::format("{:06}", pair.frame.number);
    pair.starts_anew = starts_anew;
    given_.push_back(py::make_tuple(left, right));
    const py::gil_scoped_release other_threads_run;
    video_->add(std::move(pair));
  }

  void end() { video_->end(); }

  /// (why it is left out, number, name, (left, right), maps, odometry, motion); None at the end.
  py::object next() {
    std::optional<vision::VideoFrame> made;
    {
      const py::gil_scoped_release other_threads_run;
      made = video_->next();
    }
    if (!made) return py::none();
    const vision::VideoPair& pair = made->pair;
    const bool is_readable = pair.unreadable.empty();
    py::object images = py::none(), maps = py::none();
    if (is_readable) {
      images = given_.empty() ? py::make_tuple(array_of(pair.images.left), array_of(pair.images.right)) : take(given_);
      Frame frame = take(under_way_);
      frame.report = std::move(made->report);
      maps = py::cast(std::move(frame));
    }
    return py::make_tuple(text_of(pair.unreadable), pair.frame.number, text_of(pair.frame.name), images, maps,
                          made->motion.odometry, made->motion.motion);
  }

  py::tuple warnings() const { return py::make_tuple(text_of(video_->warning()), text_of(video_->warning_of_poses())); }

  /// Drops what is under way. Nothing may be called after it.
  void close() {
    const py::gil_scoped_release other_threads_run;
    video_.reset();
  }

 private:
  template <typename T>
  static T take(std::deque<T>& queue) {
    T first = std::move(queue.front());
    queue.pop_front();
    return first;
  }

  FrameOutputs make_outputs() {
    const py::gil_scoped_acquire python;
    Frame frame{.maps = arrays_to_fill(wanted_, width_, height_), .report = {}};
    const FrameOutputs outputs = views_of(frame.maps);
    expect_apart(frame.maps, under_way_);
    under_way_.push_back(std::move(frame));
    return outputs;
  }

  const py::object keep_pipeline_;
  const int width_, height_;
  const py::object wanted_;
  vision::MotionSource motions_;
  std::optional<vision::FileSource> source_;
  std::deque<Frame> under_way_;   // whose arrays are written to
  std::deque<py::object> given_;  // pairs as Python gave them, of these frames
  int pairs_ = 0;
  std::optional<vision::StereoVideo> video_;
};

}  // namespace

void bind_video(py::module_& module) {
  module.def(
      "_size_of_image",
      [](const py::object& image) {
        const ImageArray found = image_of(image, "left");
        return py::make_tuple(found.view.width, found.view.height);
      },
      py::arg("image"));
  py::class_<Video>(module, "_Video")
      .def(py::init<const py::object&, int, int, const std::optional<Calibration>&,
                    std::optional<vision::StereoSequence>, const py::object&, int, bool, const py::kwargs&>(),
           py::arg("pipeline"), py::arg("width"), py::arg("height"), py::arg("calibration"), py::arg("sequence"),
           py::arg("outputs"), py::arg("lag"), py::arg("finds_motion"))
      .def_property_readonly("wants_pair", &Video::wants_pair)
      .def("add", &Video::add, py::arg("left"), py::arg("right"), py::arg("pose"), py::arg("starts_anew"))
      .def("end", &Video::end)
      .def("next", &Video::next)
      .def("warnings", &Video::warnings)
      .def("close", &Video::close);
}

}  // namespace egosgm::python
