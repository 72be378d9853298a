// SPDX-License-Identifier: Apache-2.0
#include "egosgm/pipeline.h"

#include <pybind11/stl.h>
#include <unistd.h>

#include <algorithm>
#include <deque>
#include <mutex>
#include <variant>

#include "egosgm/named_options.h"
#include "host/frame_outputs.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/frame.h"
#include "python/option_values.h"
#include "python/pickling.h"

namespace egosgm::python {

py::dict arrays_to_fill(const py::object& wanted, int width, int height) {
  py::dict
      arrays;  // never the caller's, which may change while the frame is under way: these references keep the arrays
  if (py::isinstance<py::dict>(wanted)) {
    arrays.attr("update")(wanted);
    return arrays;
  }
  if (!py::isinstance<py::iterable>(wanted)) {
    throw InvalidArgument("outputs is a " + py::str(py::type::of(wanted).attr("__name__")).cast<std::string>() +
                          ": give names of maps, or a dict of arrays to fill");
  }
  for (const py::handle& item : py::isinstance<py::str>(wanted) ? py::make_tuple(wanted) : py::tuple(wanted)) {
    const auto name = py::str(item).cast<std::string>();
    arrays[item] = py::array_t<float>({height, width});  // views_of refuses a name that no output has
    FrameOutputs outputs;
    for_each_output(outputs, [&]<typename T>(const OutputText& text, MapView<T>&) {
      if (name == text.name) arrays[item] = py::array_t<T>({height, width});
    });
  }
  return arrays;
}

FrameOutputs views_of(const py::dict& arrays) {
  FrameOutputs outputs;
  std::vector<std::string> known;
  for_each_output(outputs, [&]<typename T>(const OutputText& text, MapView<T>& view) {
    known.push_back(text.name);
    if (arrays.contains(text.name)) view = output_of<T>(arrays[text.name], text.name);
  });
  for (const auto& [key, array] : arrays) {
    const auto name = py::str(key).cast<std::string>();
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    std::string all;
    for (const std::string& each : known) all += (all.empty() ? "" : ", ") + each;
    throw InvalidArgument("output \"" + name + "\": choose from " + all);
  }
  return outputs;
}

void expect_apart(const py::dict& arrays, const std::deque<Frame>& under_way) {
  const py::object share = py::module_::import("numpy").attr("may_share_memory");
  std::vector<py::handle> taken;
  for (const Frame& frame : under_way) {
    for (const auto& [name, array] : frame.maps) taken.push_back(array);
  }
  const std::size_t of_others = taken.size();
  for (const auto& [name, array] : arrays) {
    for (std::size_t i = 0; i < taken.size(); ++i) {
      if (!share(array, taken[i]).cast<bool>()) continue;
      throw InvalidArgument(
          "output " + py::str(name).cast<std::string>() + " shares memory with another map that is " +
          (i < of_others ? "written until its frame is collected: collect it first, or give" : "to be filled: give") +
          " an array of its own");
    }
    taken.push_back(array);
  }
}

namespace {

std::optional<Motion> motion_of(const py::object& motion) {
  if (motion.is_none()) return std::nullopt;
  if (py::isinstance<Motion>(motion)) return motion.cast<Motion>();
  return Motion{.current_from_previous = transform_of(motion, "motion")};
}

/// One frame after the other, also where several Python threads call.
class LockedPipeline {
 public:
  LockedPipeline(const Calibration& calibration, int width, int height, const PipelineOptions& options,
                 const Device& device)
      : width_(width), height_(height), pipeline_(calibration, width, height, options, device) {}

  Frame process(const py::object& left, const py::object& right, const py::object& motion, const py::object& wanted) {
    const ImageArray left_image = image_of(left, "left"), right_image = image_of(right, "right");
    const std::optional<Motion> moved = motion_of(motion);
    Frame frame{.maps = arrays_to_fill(wanted, width_, height_), .report = {}};
    const FrameOutputs outputs = views_of(frame.maps);
    expect_apart(frame.maps, {});
    {
      const py::gil_scoped_release other_threads_run;
      const auto one_at_a_time = turn();
      frame.report = pipeline_.process(left_image.view, right_image.view, moved, outputs);
    }
    return frame;
  }

  void submit(const py::object& left, const py::object& right, const py::object& motion, const py::object& wanted) {
    const ImageArray left_image = image_of(left, "left"), right_image = image_of(right, "right");
    const std::optional<Motion> moved = motion_of(motion);
    Frame frame{.maps = arrays_to_fill(wanted, width_, height_), .report = {}};
    const FrameOutputs outputs = views_of(frame.maps);
    std::deque<Frame> dropped;  // goes when this thread may touch Python's objects again
    const py::gil_scoped_release other_threads_run;
    const auto one_at_a_time = turn();
    {
      const py::gil_scoped_acquire python;
      expect_apart(frame.maps, under_way_);
    }
    under_way_.push_back(std::move(frame));  // before anything writes to its arrays
    try {
      pipeline_.submit(left_image.view, right_image.view, moved, outputs);
    } catch (...) {
      if (pipeline_.under_way() == 0) {
        dropped.swap(under_way_);
      } else {
        dropped.push_back(std::move(under_way_.back()));
        under_way_.pop_back();
      }
      throw;
    }
  }

  Frame collect() {
    std::deque<Frame> dropped;
    std::optional<Frame> frame;
    {
      const py::gil_scoped_release other_threads_run;
      const auto one_at_a_time = turn();
      FrameReport report;
      try {
        report = pipeline_.collect();
      } catch (...) {
        if (pipeline_.under_way() == 0) dropped.swap(under_way_);
        throw;
      }
      frame.emplace(std::move(under_way_.front()));
      under_way_.pop_front();
      frame->report = std::move(report);
    }
    return std::move(*frame);
  }

  int under_way() {
    const py::gil_scoped_release other_threads_run;
    const auto one_at_a_time = turn();
    return pipeline_.under_way();
  }

  void reset() {
    const py::gil_scoped_release other_threads_run;
    const auto one_at_a_time = turn();
    pipeline_.reset();
  }

  const Pipeline& pipeline() const { return pipeline_; }
  Pipeline& pipeline() { return pipeline_; }

 private:
  /// None in a process that was forked, where another thread's turn would never end: the pipeline says what is wrong.
  std::unique_lock<std::mutex> turn() {
    return ::getpid() == process_ ? std::unique_lock(mutex_) : std::unique_lock<std::mutex>();
  }

  const int width_, height_;
  const pid_t process_ = ::getpid();
  std::mutex mutex_;
  std::deque<Frame> under_way_;  // submitted: their arrays are written to
  Pipeline pipeline_;
};

std::unique_ptr<LockedPipeline> make_pipeline(const Calibration& calibration, int width, int height,
                                              const std::variant<std::string, int>& device, const std::string& preset,
                                              const std::string& cache, const py::kwargs& values) {
  const int* number = std::get_if<int>(&device);
  const std::string name = number ? std::to_string(*number) : std::get<std::string>(device);
  PipelineOptions options = options_of_preset(preset);
  set_options(options, values);
  options.validate();
  const py::gil_scoped_release other_threads_run;
  return std::make_unique<LockedPipeline>(calibration, width, height, options, Device::select(name).with_cache(cache));
}

py::list stages_of(const FrameReport& report) {
  py::list stages;
  for (const StageTime& stage : report.stages) stages.append(py::make_tuple(stage.stage, stage.ms));
  return stages;
}

void bind_frame(py::module_& module) {
  auto report = py::class_<FrameReport>(module, "FrameReport", "What happened in a frame.");
  pickle_members<&FrameReport::unpredicted, &FrameReport::repeated, &FrameReport::searched_everything,
                 &FrameReport::search_fraction, &FrameReport::predicted_fraction, &FrameReport::density,
                 &FrameReport::vertical_offset_px, &FrameReport::launches, &FrameReport::stripes, &FrameReport::stages,
                 &FrameReport::total_ms>(report);
  report
      .def_property_readonly(
          "unpredicted", [](const FrameReport& report) { return to_string(report.unpredicted); },
          "Why nothing was predicted: 'first frame', 'reset', 'no motion' or 'not temporal'; '' where something was.")
      .def_readonly("repeated", &FrameReport::repeated,
                    "The pair is that of the frame before: the camera is taken to stand, and the motion counts for the "
                    "next one.")
      .def_readonly("searched_everything", &FrameReport::searched_everything,
                    "The whole range at every pixel: without a prediction, or not trusting it.")
      .def_readonly("search_fraction", &FrameReport::search_fraction,
                    "All cells that were matched, over those of one match of the full range. More than 1 in a frame "
                    "that is matched twice: a first one, or one without `temporal`.")
      .def_readonly("predicted_fraction", &FrameReport::predicted_fraction, "Left pixels with a prediction.")
      .def_readonly("density", &FrameReport::density, "Left pixels with a disparity.")
      .def_readonly("vertical_offset_px", &FrameReport::vertical_offset_px)
      .def_readonly("stripes", &FrameReport::stripes, "In which the image was matched.")
      .def_readonly("launches", &FrameReport::launches)
      .def_readonly("total_ms", &FrameReport::total_ms, "Wall clock, upload to download.")
      .def_property_readonly("stages", &stages_of, "(name, milliseconds) in the order in which they ran.");

  auto frame = py::class_<Frame>(module, "Frame",
                                 "A frame's maps, H x W: disparities in pixels, variances in px^2, INVALID_DISPARITY "
                                 "(and variance 0) where there is no value. None where not asked for.");
  py::list texts;  // (name, type, meaning)
  for (const OutputText& text : output_texts()) {
    frame.def_property_readonly(
        text.name, [name = text.name](const Frame& f) { return f.map(name); }, text.meaning);
    texts.append(py::make_tuple(text.name, text.values, text.meaning));
  }
  module.attr("_OUTPUTS") = py::tuple(texts);
  frame.def_readonly("report", &Frame::report);
  pickle_members<&Frame::maps, &Frame::report>(frame);

  py::tuple reasons(kReasonCount);
  for (int reason = 0; reason < kReasonCount; ++reason) reasons[reason] = to_string(static_cast<Reason>(reason));
  module.attr("REASONS") = reasons;  // by the values of Frame.reason
}

}  // namespace

Pipeline& pipeline_of(const py::object& pipeline) { return pipeline.cast<LockedPipeline&>().pipeline(); }

void bind_pipeline(py::module_& module) {
  bind_frame(module);
  py::class_<LockedPipeline>(module, "Pipeline")
      .def(py::init(&make_pipeline), py::arg("calibration"), py::arg("width"), py::arg("height"), py::kw_only(),
           py::arg("device") = "", py::arg("preset") = "default", py::arg("cache") = "")
      .def("process", &LockedPipeline::process, py::arg("left"), py::arg("right"), py::arg("motion") = py::none(),
           py::arg("outputs") = py::make_tuple("disparity", "variance"),
           "Matches one rectified pair.\n\n"
           "left, right: H x W of uint8 or uint16, both alike; rows at any stride are read where they are.\n"
           "motion: how the camera moved since the last frame, a Motion or a 4x4 matrix current_from_previous; None: "
           "the whole range is searched.\n"
           "outputs: names of the maps to make, or a dict of arrays to fill, of the types that Frame's maps have.\n\n"
           "Raises InvalidArgument before anything runs, or DeviceError. A frame that raises leaves the pipeline as "
           "it was. Other Python threads run meanwhile; several that call one pipeline take turns.")
      .def("submit", &LockedPipeline::submit, py::arg("left"), py::arg("right"), py::arg("motion") = py::none(),
           py::arg("outputs") = py::make_tuple("disparity", "variance"),
           "The first half of process: copies the images, starts the frame and returns, so that Python may read and "
           "estimate the next one meanwhile. At most two frames may be under way. Arrays to fill are kept and "
           "written until their frame is collected; the dict may be used again at once, with other arrays in it.")
      .def("collect", &LockedPipeline::collect,
           "The second half: waits for the oldest frame under way and returns it. The bits are those of process. "
           "Raises InvalidArgument where none is under way, and DeviceError where one has failed: all are dropped "
           "then.")
      .def_property_readonly("under_way", &LockedPipeline::under_way, "Frames submitted and not collected.")
      .def("reset", &LockedPipeline::reset, "Forgets the last frame: the next one searches the whole range.")
      .def_property_readonly(
          "options", [](const LockedPipeline& p) { return dict_of(p.pipeline().options()); }, "All options by name.")
      .def_property_readonly("device", [](const LockedPipeline& p) { return p.pipeline().device().info(); })
      .def_property_readonly(
          "device_memory_bytes", [](const LockedPipeline& p) { return p.pipeline().device_memory_bytes(); },
          "Allocated on the device, constant.");
}

}  // namespace egosgm::python
