// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/video_evaluation.h"

#include <pybind11/stl.h>

#include "egosgm/error.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/other_threads.h"

namespace egosgm::python {
namespace {

using vision::NamedFigure;
using vision::VideoFrame;

/// The maps of one kind: anything that is indexed by a frame's number, None where there is none. Used by threads that
/// hold the interpreter's lock.
struct Maps {
  py::object items;
  const char* name;

  /// A copy, since the array may be gone when the lock is.
  cv::Mat at(int i) const {
    if (items.is_none()) return {};
    const py::object item = items[py::int_(i)];
    if (item.is_none()) return {};
    py::array keep;
    return map_of(item, name, keep).clone();
  }

  cv::Mat mask_at(int i) const {
    const cv::Mat values = at(i);
    return values.empty() ? cv::Mat() : cv::Mat(values != 0);
  }

  /// An H x W x 2 array.
  cv::Mat flow_at(int i) const {
    const py::object item = items.is_none() ? py::none() : py::object(items[py::int_(i)]);
    if (item.is_none()) return {};
    const py::array_t<float, py::array::c_style | py::array::forcecast> flow(item);
    if (flow.ndim() != 3 || flow.shape(2) != 2 || flow.size() == 0) {
      throw InvalidArgument(std::string(name) + ": give H x W x 2 arrays");
    }
    return cv::Mat(static_cast<int>(flow.shape(0)), static_cast<int>(flow.shape(1)), CV_32FC2,
                   const_cast<float*>(flow.data()))
        .clone();
  }

  cv::Mat image_at(int i) const {
    if (items.is_none() || py::object(items[py::int_(i)]).is_none()) return {};
    const ImageArray image = image_of(items[py::int_(i)], name);
    const int type = image.view.type == PixelType::kU8 ? CV_8UC1 : CV_16UC1;
    cv::Mat copy(image.view.height, image.view.width, type);
    for (int y = 0; y < copy.rows; ++y) {
      const auto* row = static_cast<const std::uint8_t*>(image.view.data) + y * image.view.stride_bytes;
      std::copy(row, row + copy.cols * copy.elemSize(), copy.ptr(y));
    }
    return copy;
  }
};

py::dict dict_of(const std::vector<NamedFigure>& figures) {
  py::dict dict;
  for (const NamedFigure& figure : figures) dict[figure.name] = figure.value;
  return dict;
}

py::dict dict_of(const vision::DensityCounts& counts) {
  py::list density, reached, bad, kept, kept_bad, oracle_bad, mae, oracle_mae;
  for (const vision::DensityPoint& point : densities_of(counts)) {
    density.append(point.density_percent);
    reached.append(point.reached_percent);
    bad.append(point.bad_percent);
  }
  for (const vision::SparsificationPoint& point : sparsification_of(counts)) {
    kept.append(point.kept_percent);
    kept_bad.append(point.bad_percent);
    oracle_bad.append(point.oracle_bad_percent);
    mae.append(point.mae_px);
    oracle_mae.append(point.oracle_mae_px);
  }
  using namespace py::literals;
  return py::dict("density_percent"_a = density, "reached_percent"_a = reached, "bad_percent"_a = bad,
                  "kept_percent"_a = kept, "kept_bad_percent"_a = kept_bad, "oracle_bad_percent"_a = oracle_bad,
                  "kept_mae_px"_a = mae, "oracle_mae_px"_a = oracle_mae);
}

py::dict dict_of(const vision::VideoEvaluation& evaluation) {
  py::list frames;
  for (const vision::VideoCounts& frame : evaluation.frames) frames.append(dict_of(figures_of(frame)));
  py::dict regions;
  for (std::size_t r = 0; r < evaluation.total.regions.size(); ++r) {
    const vision::RegionCounts& region = evaluation.total.regions[r];
    if (region.errors.truth == 0) continue;
    py::dict figures = dict_of(figures_of(region));
    figures["truth_pixels"] = region.errors.truth;
    regions[vision::kRegionNames[r]] = figures;
  }
  py::dict result;
  result["figures"] = dict_of(figures_of(evaluation.total));
  result["frames"] = frames;
  result["regions"] = regions;
  result["density"] =
      evaluation.total.density.truth > 0 ? py::object(dict_of(evaluation.total.density)) : py::object(py::none());
  return result;
}

py::dict evaluate_video(const py::object& estimates, const py::object& truths, const py::object& all_truths,
                        const py::object& against, const py::object& uncertainties, const py::object& moving,
                        const py::object& images, const py::object& flows, const py::object& next_truths,
                        const py::object& reasons, std::optional<Calibration> calibration,
                        const py::object& world_from_camera, float near_px, int threads) {
  const Maps maps[] = {{estimates, "estimates"},         {truths, "truths"},
                       {all_truths, "all_truths"},       {against, "against"},
                       {uncertainties, "uncertainties"}, {next_truths, "next_truths"}};
  const Maps masks{moving, "moving"}, why{reasons, "reasons"}, pictures{images, "images"}, flow{flows, "flows"};
  vision::Video video;
  video.frames = static_cast<int>(py::len(estimates));
  video.read = [&](int i) {
    const py::gil_scoped_acquire lock;
    end_with_interpreter();
    VideoFrame frame;
    cv::Mat* const targets[] = {&frame.estimate, &frame.truth,       &frame.all_truth,
                                &frame.against,  &frame.uncertainty, &frame.next_truth};
    for (std::size_t m = 0; m < std::size(maps); ++m) *targets[m] = maps[m].at(i);
    frame.moving = masks.mask_at(i);
    frame.reason = why.image_at(i);
    frame.image = pictures.image_at(i);
    frame.flow_to_next = flow.flow_at(i);
    return frame;
  };
  std::vector<Eigen::Isometry3d> poses;
  if (!world_from_camera.is_none()) poses = transforms_of(world_from_camera, "world_from_camera");
  if (!poses.empty() && (!calibration || static_cast<int>(poses.size()) != video.frames)) {
    throw InvalidArgument("world_from_camera has " + std::to_string(poses.size()) + " poses of " +
                          std::to_string(video.frames) + " frames" + (calibration ? "" : " and no calibration") +
                          ": give one for each frame, with the calibration");
  }
  video.calibration = calibration;
  if (!poses.empty()) {
    video.current_from_previous = [&](int i) { return std::optional(poses[i].inverse() * poses[i - 1]); };
  }
  vision::VideoEvaluation evaluation;
  {
    const OtherThreadsRun other_threads_run;
    evaluation = vision::evaluate_video(video, {.near_px = near_px, .threads = threads});
  }
  return dict_of(evaluation);
}

}  // namespace

void bind_video_evaluation(py::module_& module) {
  module.def("_evaluate_video", &evaluate_video);
  module.def(
      "move_map",
      [](const py::object& disparity, const Calibration& calibration, const py::object& current_from_previous) {
        py::array keep;
        return array_of(vision::move_map(map_of(disparity, "disparity", keep), calibration,
                                         transform_of(current_from_previous, "current_from_previous")));
      },
      py::arg("disparity"), py::arg("calibration"), py::arg("current_from_previous"),
      "A disparity map as the next frame sees it, the nearest surface on top; INVALID_DISPARITY where nothing lies.");
}

}  // namespace egosgm::python
