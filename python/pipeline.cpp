// SPDX-License-Identifier: Apache-2.0
#include "egosgm/pipeline.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <deque>
#include <mutex>

#include "egosgm/named_options.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/option_values.h"

namespace egosgm::python {
namespace {

/// What a frame can give, by name.
template <typename Visit>
void for_each_output(FrameOutputs& outputs, Visit&& visit) {
  visit("disparity", outputs.disparity);
  visit("variance", outputs.variance);
  visit("right_disparity", outputs.right_disparity);
  visit("right_variance", outputs.right_variance);
  visit("predicted", outputs.predicted);
  visit("predicted_variance", outputs.predicted_variance);
  visit("measured", outputs.measured);
  visit("measured_variance", outputs.measured_variance);
  visit("search_width", outputs.search_width);
  visit("dynamic", outputs.dynamic);
}

struct Frame {
  py::dict maps;
  FrameReport report;

  py::object map(const char* name) const { return maps.contains(name) ? py::object(maps[name]) : py::none(); }
};

PipelineOptions preset_named(const std::string& name) {
  PipelineOptions options;
  set_option(options, "preset", name);
  return options;
}

/// A dict of arrays to fill, or names of arrays to make.
py::dict arrays_to_fill(const py::object& wanted, int width, int height) {
  py::dict
      arrays;  // never the caller's, which may change while the frame is under way: these references keep the arrays
  if (py::isinstance<py::dict>(wanted)) {
    arrays.attr("update")(wanted);
    return arrays;
  }
  for (const py::handle& item : py::isinstance<py::str>(wanted) ? py::make_tuple(wanted) : py::tuple(wanted)) {
    const auto name = item.cast<std::string>();
    if (name == "search_width") {
      arrays[item] = py::array_t<std::uint16_t>({height, width});
    } else if (name == "dynamic") {
      arrays[item] = py::array_t<std::uint8_t>({height, width});
    } else {
      arrays[item] = py::array_t<float>({height, width});
    }
  }
  return arrays;
}

template <typename T>
MapView<T> view_of(const py::dict& arrays, const char* name, MapView<T>) {
  return output_of<T>(arrays[name], name);
}

FrameOutputs views_of(const py::dict& arrays) {
  FrameOutputs outputs;
  std::vector<std::string> known;
  for_each_output(outputs, [&](const char* name, auto& view) {
    known.push_back(name);
    if (arrays.contains(name)) view = view_of(arrays, name, view);
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

/// Throws InvalidArgument where a map to fill shares memory with another one of its frame or of one under way.
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

std::optional<Motion> motion_of(const py::object& motion) {
  if (motion.is_none()) return std::nullopt;
  if (py::isinstance<Motion>(motion)) return motion.cast<Motion>();
  return Motion{.current_from_previous = transform_of(motion, "motion")};
}

Motion make_motion(const py::object& current_from_previous, const py::object& covariance) {
  Motion motion{.current_from_previous = transform_of(current_from_previous, "current_from_previous")};
  if (!covariance.is_none()) {
    const auto values = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(covariance);
    if (!values || values.ndim() != 2 || values.shape(0) != 6 || values.shape(1) != 6) {
      PyErr_Clear();
      throw InvalidArgument("covariance: give a 6x6 matrix of (translation [m], rotation [rad])");
    }
    motion.covariance = Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(values.data());
  }
  motion.validate();
  return motion;
}

py::array_t<double> array_of_covariance(const Motion& motion) {
  py::array_t<double> array({6, 6});
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(array.mutable_data()) = motion.covariance;
  return array;
}

/// One frame after the other, also where several Python threads call.
class LockedPipeline {
 public:
  LockedPipeline(const Calibration& calibration, int width, int height, const PipelineOptions& options,
                 const std::string& device)
      : width_(width), height_(height), pipeline_(calibration, width, height, options, Device::select(device)) {}

  Frame process(const py::object& left, const py::object& right, const py::object& motion, const py::object& wanted) {
    const ImageArray left_image = image_of(left, "left"), right_image = image_of(right, "right");
    const std::optional<Motion> moved = motion_of(motion);
    Frame frame{.maps = arrays_to_fill(wanted, width_, height_), .report = {}};
    const FrameOutputs outputs = views_of(frame.maps);
    expect_apart(frame.maps, {});
    {
      const py::gil_scoped_release other_threads_run;
      const std::lock_guard one_at_a_time(mutex_);
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
    const std::lock_guard one_at_a_time(mutex_);
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
      const std::lock_guard one_at_a_time(mutex_);
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
    const std::lock_guard one_at_a_time(mutex_);
    return pipeline_.under_way();
  }

  void reset() {
    const py::gil_scoped_release other_threads_run;
    const std::lock_guard one_at_a_time(mutex_);
    pipeline_.reset();
  }

  const Pipeline& pipeline() const { return pipeline_; }

 private:
  const int width_, height_;
  std::mutex mutex_;
  std::deque<Frame> under_way_;  // submitted: their arrays are written to
  Pipeline pipeline_;
};

std::unique_ptr<LockedPipeline> make_pipeline(const Calibration& calibration, int width, int height,
                                              const std::string& device, const std::string& preset,
                                              const py::kwargs& values) {
  PipelineOptions options = preset_named(preset);
  set_options(options, values);
  options.validate();
  const py::gil_scoped_release other_threads_run;
  return std::make_unique<LockedPipeline>(calibration, width, height, options, device);
}

Calibration make_calibration(double fx, double fy, double cx, double cy, double baseline_m, double doffs_px) {
  const Calibration calibration{fx, fy, cx, cy, baseline_m, doffs_px};
  calibration.validate();
  return calibration;
}

std::string repr_of(const Calibration& c) {
  return py::str("Calibration(fx={}, fy={}, cx={}, cy={}, baseline_m={}, doffs_px={})")
      .format(c.fx, c.fy, c.cx, c.cy, c.baseline_m, c.doffs_px);
}

std::vector<DeviceInfo> devices() {
  std::vector<DeviceInfo> list;
  for (const Device& device : Device::list()) list.push_back(device.info());
  return list;
}

py::list stages_of(const FrameReport& report) {
  py::list stages;
  for (const StageTime& stage : report.stages) stages.append(py::make_tuple(stage.stage, stage.ms));
  return stages;
}

void bind_values(py::module_& module) {
  py::class_<Calibration>(module, "Calibration",
                          "A rectified stereo pair. Disparity is d = x_left - x_right [px], depth is "
                          "fx * baseline_m / (d + doffs_px) [m].")
      .def(py::init(&make_calibration), py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"),
           py::arg("baseline_m"), py::arg("doffs_px") = 0.0)
      .def_readonly("fx", &Calibration::fx, "Focal length [px].")
      .def_readonly("fy", &Calibration::fy, "Focal length [px].")
      .def_readonly("cx", &Calibration::cx, "Principal point of the left camera [px].")
      .def_readonly("cy", &Calibration::cy, "Principal point of the left camera [px].")
      .def_readonly("baseline_m", &Calibration::baseline_m, "The right camera stands at (baseline_m, 0, 0) [m].")
      .def_readonly("doffs_px", &Calibration::doffs_px, "cx_right - cx [px].")
      .def("__repr__", &repr_of);

  py::class_<Motion>(module, "Motion",
                     "How the left camera moved: a 4x4 matrix that takes a point from the previous left camera's frame "
                     "(x right, y down, z forward, metres) to the current one's.")
      .def(py::init(&make_motion), py::arg("current_from_previous"), py::arg("covariance") = py::none())
      .def_property_readonly("current_from_previous",
                             [](const Motion& motion) { return array_of(motion.current_from_previous); })
      .def_property_readonly("covariance", &array_of_covariance,
                             "6x6, of (translation [m], rotation [rad]); zero where it is not known.");

  py::class_<DeviceInfo>(module, "DeviceInfo", "What an OpenCL device says of itself.")
      .def_readonly("name", &DeviceInfo::name)
      .def_readonly("type", &DeviceInfo::type)
      .def_readonly("vendor", &DeviceInfo::vendor)
      .def_readonly("platform", &DeviceInfo::platform)
      .def_readonly("version", &DeviceInfo::version)
      .def_readonly("driver", &DeviceInfo::driver)
      .def_readonly("compute_units", &DeviceInfo::compute_units)
      .def_readonly("memory_bytes", &DeviceInfo::memory_bytes)
      .def_readonly("max_allocation_bytes", &DeviceInfo::max_allocation_bytes)
      .def("__repr__", [](const DeviceInfo& info) { return "<DeviceInfo '" + info.name + "' (" + info.type + ")>"; });
  module.def("devices", &devices, py::call_guard<py::gil_scoped_release>(),
             "All OpenCL devices, in the order in which they are preferred.");
  module.def(
      "pipeline_options", [](const std::string& preset) { return dict_of(preset_named(preset)); },
      py::arg("preset") = "default", "All options of Pipeline by name, with the values of a preset.");
  module.def(
      "_option_texts",
      [] {
        py::list texts;
        for (const OptionText& t : option_texts()) {
          texts.append(py::make_tuple(t.name, t.meaning, t.unit, t.range, t.when_to_change));
        }
        return texts;
      },
      "Name, meaning, unit, range and when to change, of every option of Pipeline.");
}

void bind_frame(py::module_& module) {
  py::class_<FrameReport>(module, "FrameReport", "What happened in a frame.")
      .def_property_readonly(
          "unpredicted", [](const FrameReport& report) { return to_string(report.unpredicted); },
          "Why nothing was predicted: 'first frame', 'reset', 'no motion' or 'not temporal'; '' where something was.")
      .def_readonly("searched_everything", &FrameReport::searched_everything,
                    "The whole range at every pixel: without a prediction, or not trusting it.")
      .def_readonly("search_fraction", &FrameReport::search_fraction,
                    "All cells that were matched, over those of one match of the full range. More than 1 in a first "
                    "frame, which is matched twice.")
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
  FrameOutputs outputs;
  for_each_output(outputs, [&](const char* name, auto&) {
    frame.def_property_readonly(name, [name](const Frame& f) { return f.map(name); });
  });
  frame.def_readonly("report", &Frame::report);
}

}  // namespace

void bind_pipeline(py::module_& module) {
  bind_values(module);
  bind_frame(module);
  py::class_<LockedPipeline>(module, "Pipeline")
      .def(py::init(&make_pipeline), py::arg("calibration"), py::arg("width"), py::arg("height"), py::kw_only(),
           py::arg("device") = "", py::arg("preset") = "default")
      .def("process", &LockedPipeline::process, py::arg("left"), py::arg("right"), py::arg("motion") = py::none(),
           py::arg("outputs") = py::make_tuple("disparity", "variance"),
           "Matches one rectified pair.\n\n"
           "left, right: H x W of uint8 or uint16, both alike; rows at any stride are read where they are.\n"
           "motion: how the camera moved since the last frame, a Motion or a 4x4 matrix current_from_previous; None: "
           "the whole range is searched.\n"
           "outputs: names of the maps to make, or a dict of arrays to fill (float32; search_width: uint16, dynamic: "
           "uint8).\n\n"
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
