// SPDX-License-Identifier: Apache-2.0
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "apps/output_folder.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/dataset.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/point_cloud.h"
#include "egosgm/vision/poses_io.h"
#include "host/json_text.h"
#include "python/arrays.h"
#include "python/bindings.h"
#include "python/pickling.h"
#include "vision/file_io.h"
#include "vision/file_kinds.h"
#include "vision/folder_contents.h"
#include "vision/foreign_file.h"
#include "vision/frame_panels.h"
#include "vision/frame_source.h"
#include "vision/image_pairs.h"

namespace egosgm::python {
namespace {

using std::filesystem::path;
using vision::StereoFrame;
using vision::StereoSequence;

py::tuple read_images(const StereoFrame& frame) {
  vision::StereoImages images;
  {
    const py::gil_scoped_release other_threads_run;
    images = vision::read_images(frame);
  }
  return py::make_tuple(array_of(images.left), array_of(images.right));
}

void bind_sequences(py::module_& module) {
  auto frame =
      py::class_<StereoFrame>(module, "StereoFrame", "One stereo pair on disk, and its truth where there is one.");
  pickle_members<&StereoFrame::number, &StereoFrame::name, &StereoFrame::left, &StereoFrame::right,
                 &StereoFrame::truth_noc, &StereoFrame::truth_occ>(frame);
  frame.def_readonly("number", &StereoFrame::number)
      .def_readonly("name", &StereoFrame::name, "The number with six digits, or a time of more digits.")
      .def_readonly("left", &StereoFrame::left)
      .def_readonly("right", &StereoFrame::right)
      .def_readonly("truth_noc", &StereoFrame::truth_noc,
                    "Left disparity of non-occluded pixels; pathlib.Path(): none.")
      .def_readonly("truth_occ", &StereoFrame::truth_occ, "Left disparity of all pixels; pathlib.Path(): none.")
      .def("read", &read_images, "Both images as grey: (left, right).");
  auto sequence =
      py::class_<StereoSequence>(module, "StereoSequence", "Frames of one rectified camera pair, one after the other.");
  pickle_members<&StereoSequence::title, &StereoSequence::frames, &StereoSequence::numbers, &StereoSequence::note,
                 &StereoSequence::has_calibration, &StereoSequence::calibration, &StereoSequence::calibrated_width,
                 &StereoSequence::calibrated_height, &StereoSequence::calibration_file, &StereoSequence::poses_file,
                 &StereoSequence::times_file>(sequence);
  sequence.def_property_readonly("title", [](const StereoSequence& s) { return text_of(s.title); })
      .def_readonly("frames", &StereoSequence::frames)
      .def_readonly("numbers", &StereoSequence::numbers, "Of all frames that are there, chosen or not.")
      .def_property_readonly(
          "note", [](const StereoSequence& s) { return text_of(s.note); },
          "What is unusual, such as gaps in the numbers; empty: nothing.")
      .def_property_readonly(
          "calibration",
          [](const StereoSequence& s) { return s.has_calibration ? std::optional(s.calibration) : std::nullopt; },
          "None where the images came without one.")
      .def_readonly("times_file", &StereoSequence::times_file,
                    "When the frames were taken; pathlib.Path() where no file says so.")
      .def_readonly("poses_file", &StereoSequence::poses_file, "The true poses; pathlib.Path() where there are none.")
      .def_property_readonly(
          "size",
          [](StereoSequence images) {
            images.calibrated_width = 0;  // whoever takes the calibration, too, calls _expect_calibrated
            const vision::Size size = vision::FileSource(std::move(images)).size();
            return py::make_tuple(size.width, size.height);
          },
          "(width, height) of all images. Reads a pair: the headers of files that hold no more are not believed.")
      .def("__len__", [](const StereoSequence& s) { return s.frames.size(); });

  module.def(
      "open_folder",
      [](const path& folder, const std::string& frames) { return vision::open_folder(folder, range_of(frames)); },
      py::arg("folder"), py::arg("frames") = "",
      "Opens a folder in the layout of KITTI odometry, KITTI raw or Middlebury, with left and right, or with a folder "
      "for "
      "each pair, and their calib.txt. "
      "frames: \"7:10\", \"7:\", \":10\".");
  module.def(
      "_expect_calibrated", [](const StereoSequence& sequence) { vision::check_image_sizes(sequence); },
      py::arg("sequence"), "Throws InvalidArgument where its calibration is of images of another size.");
  module.def(
      "open_kitti_multiview",
      [](const path& folder, const std::string& scene, const std::string& frames) {
        return vision::open_kitti_multiview(folder, scene, range_of(frames));
      },
      py::arg("folder"), py::arg("scene"), py::arg("frames") = "", "KITTI 2012 or 2015 multi-view.");
  module.def(
      "open_patterns",
      [](const path& left, const path& right, const path& calibration, const std::string& frames, bool by_order) {
        return vision::open_patterns(left.string(), right.string(), calibration, range_of(frames),
                                     by_order ? vision::PairBy::kOrder : vision::PairBy::kName);
      },
      py::arg("left"), py::arg("right"), py::arg("calibration") = "", py::arg("frames") = "",
      py::arg("by_order") = false,
      "PNG or JPEG files or patterns such as 'left/%06d.png' or 'left/*.jpg'. by_order: the first left image belongs "
      "to\n"
      "the first right one, and so on; else those of equal names belong together.");
}

vision::Image read_if_there(const path& file, vision::Image (*read)(const path&)) {
  return std::filesystem::exists(file) ? read(file) : vision::Image();
}

/// (name, picture, colour bar or None) of each map that the run in `folder` wrote of a frame, of its left image and of
/// the error, where `left` and `truth` are not empty.
py::list layers_of_run(vision::FramePanels& panels, const path& folder, const std::string& name, const path& left,
                       const path& truth) {
  StereoFrame frame;
  frame.name = name, frame.left = left, frame.truth_noc = truth;
  const auto file = [&](const char* kind, const char* extension) { return folder / kind / (name + extension); };
  const auto grey = [](const path& of) { return vision::read_grey_image(of); };
  const path exact = file("disparity", ".pfm");
  const vision::Image disparity =
      vision::read_disparity(std::filesystem::exists(exact) ? exact : file("disparity", ".png"));
  const vision::Image variance =
      read_if_there(file("variance", ".pfm"), [](const path& of) { return vision::read_pfm(of); });
  const vision::Image search = read_if_there(file("search", ".png"), grey);
  const vision::Image reasons = read_if_there(file("reason", ".png"), grey);
  py::list layers;
  for (const vision::Layer& layer : panels.layers({frame, {}, disparity, variance, search, reasons})) {
    const py::object bar = layer.bar.empty() ? py::object(py::none()) : py::object(array_of(layer.bar));
    layers.append(py::make_tuple(layer.name, array_of(layer.picture), bar));
  }
  return layers;
}

py::bytes read_file(const path& file, std::size_t max_bytes) {
  std::string bytes;
  {
    const py::gil_scoped_release other_threads_run;
    bytes = vision::read_file(file, max_bytes);
  }
  return py::bytes(bytes);
}

/// A file's JSON as bytes, once it is found to be JSON, and bounded.
py::bytes read_json(const path& file) {
  const std::string bytes = vision::read_file(file, kMaxJsonBytes);
  if (parse_json(bytes, file).is_discarded()) {
    throw InvalidArgument(file.string() + ": is no JSON: it was cut or edited; run it again");
  }
  return py::bytes(bytes);
}

/// Throws IoError where a file has come there meanwhile.
void write_new_file(const path& file, const py::bytes& bytes) {
  const vision::KeepFiles others;
  vision::write_file(file, static_cast<std::string>(bytes));
}

void write_new_calibration(const path& file, const Calibration& calibration) {
  const vision::KeepFiles others;
  vision::write_calibration(file, calibration);
}

/// (pairs of files, files without one of the other camera).
py::tuple find_pairs(const path& left, const path& right, bool by_order) {
  const vision::ImagePairs found =
      vision::find_pairs(left.string(), right.string(), by_order ? vision::PairBy::kOrder : vision::PairBy::kName);
  return py::make_tuple(py::cast(found.pairs), py::cast(found.alone));
}

std::int64_t write_disparity(const path& file, const py::object& map) {
  py::array keep;
  return vision::write_disparity(file, map_of(map, "disparity", keep));
}

void write_pfm(const path& file, const py::object& map) {
  py::array keep;
  vision::write_pfm(file, map_of(map, "map", keep));
}

/// N x 3 values, of any numbers, as vectors. Throws InvalidArgument for another shape.
template <typename T, typename Vector>
std::vector<Vector> vectors_of(const std::optional<py::array_t<T, py::array::c_style | py::array::forcecast>>& array,
                               const char* name) {
  if (!array) return {};
  if (array->ndim() != 2 || array->shape(1) != 3) {
    throw InvalidArgument(std::string(name) + " need a row of three numbers for each point: give an N x 3 array");
  }
  const auto* first = reinterpret_cast<const Vector*>(array->data());
  return {first, first + array->shape(0)};
}

using Floats = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Bytes = py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>;

void write_ply(const path& file, const Floats& points, const std::optional<Bytes>& bgr,
               const std::optional<Floats>& normals, bool is_new) {
  vision::PointCloud cloud;
  cloud.points_m = vectors_of<float, std::array<float, 3>>(points, "points");
  cloud.colors = vectors_of<std::uint8_t, vision::Color>(bgr, "colors");
  cloud.normals = vectors_of<float, std::array<float, 3>>(normals, "normals");
  const py::gil_scoped_release other_threads_run;
  std::optional<vision::KeepFiles> others;
  if (is_new) others.emplace();
  vision::write_ply(file, cloud);
}

/// (points, BGR, what was left out) of H x W maps and H x W x 3 colours, BGR.
py::tuple point_cloud(const py::object& disparity, const py::object& variance, const Bytes& bgr,
                      const Calibration& calibration, double max_relative_sigma, double max_depth_m, double max_jump_px,
                      const std::vector<int>& kept, const std::optional<Bytes>& reasons) {
  py::array keep_disparity, keep_variance;
  const vision::Image d = map_of(disparity, "disparity", keep_disparity),
                      p = map_of(variance, "variance", keep_variance);
  if (reasons && reasons->ndim() != 2) throw InvalidArgument("reason: give an H x W map of uint8");
  const auto mat_of = [](const Bytes& bytes, vision::ImageType type) {
    return vision::Image(static_cast<int>(bytes.shape(0)), static_cast<int>(bytes.shape(1)), type,
                         const_cast<std::uint8_t*>(bytes.data()), static_cast<std::size_t>(bytes.strides(0)));
  };
  vision::PointCloudOptions options{max_relative_sigma, max_depth_m, max_jump_px, {}};
  for (const int reason : kept) options.reasons.push_back(static_cast<Reason>(reason));
  const vision::PointCloud cloud = vision::point_cloud(d, p, mat_of(bgr, vision::kBgr8), calibration, options,
                                                       reasons ? mat_of(*reasons, vision::kU8) : vision::Image());
  const auto count = static_cast<py::ssize_t>(cloud.points_m.size());
  const vision::LeftOut& out = cloud.left_out;
  return py::make_tuple(
      py::array_t<float>({count, py::ssize_t{3}}, reinterpret_cast<const float*>(cloud.points_m.data())),
      py::array_t<std::uint8_t>({count, py::ssize_t{3}}, reinterpret_cast<const std::uint8_t*>(cloud.colors.data())),
      py::dict(py::arg("far") = out.far, py::arg("uncertain") = out.uncertain, py::arg("reason") = out.reason,
               py::arg("alone") = out.alone));
}

}  // namespace

vision::FrameRange range_of(const std::string& frames) {
  return frames.empty() ? vision::FrameRange{} : vision::parse_frame_range(frames);
}

void bind_files(py::module_& module) {
  bind_sequences(module);
  py::class_<vision::FramePanels>(module, "_FramePanels")
      .def(py::init<int>(), py::arg("disparities"))
      .def("layers", &layers_of_run, py::arg("folder"), py::arg("name"), py::arg("left"), py::arg("truth"));
  module.def("_read_file", &read_file, py::arg("file"), py::arg("max_bytes"));
  module.def("_read_json", &read_json, py::arg("file"));
  module.def("_write_new_file", &write_new_file, py::arg("file"), py::arg("bytes"));
  module.def("_write_new_calibration", &write_new_calibration, py::arg("file"), py::arg("calibration"));
  module.def("_find_pairs", &find_pairs, py::arg("left"), py::arg("right"), py::arg("by_order"));
  module.def(
      "_find_images", [](const path& pattern) { return vision::find_images(pattern.string()); }, py::arg("pattern"));
  module.def(
      "_read_stored_image", [](const path& file) { return array_of(vision::read_stored_image(file)); },
      py::arg("file"));
  module.def(
      "_expect_new_file",
      [](const std::string& option, const path& file) { app::expect_new_file(option, file.string()); },
      py::arg("option"), py::arg("file"));
  module.def(
      "_expect_new_folder",
      [](const std::string& option, const path& folder) { app::new_folder(option, folder.string()); },
      py::arg("option"), py::arg("folder"));
  module.def("_is_bag", &vision::is_bag, py::arg("path"));
  module.def("_is_video", &vision::is_video, py::arg("file"));
  module.def(
      "_foreign_kind",
      [](const path& file) {
        const std::string start = vision::read_file_start(file, vision::kKindBytes);
        return vision::foreign_kind(start, vision::is_bag(file) ? file : path());
      },
      py::arg("file"),
      "What a file is by its first bytes, whatever its name where it is no bag's, and what to do with it.");
  module.def(
      "_find_two_cameras",
      [](const path& folder) -> std::optional<std::pair<std::string, std::string>> {
        const auto cameras = vision::find_two_cameras(folder);
        if (!cameras || !cameras->calibration.empty()) return std::nullopt;
        return std::pair(cameras->left, cameras->right);
      },
      py::arg("folder"), "Patterns of the left and the right images of a folder without a calibration of its own.");
  module.def("_is_own_calibration", &vision::is_own_calibration, py::arg("file"));
  module.def(
      "_read_calibration",
      [](const path& file) {
        const vision::SizedCalibration found = vision::read_sized_calibration(file);
        return py::make_tuple(found.calibration, py::make_tuple(found.width, found.height));
      },
      py::arg("file"),
      "Reads KITTI's, Middlebury's or EgoSGM's own format: (calibration, size); a size of 0: unknown.");
  module.def("write_calibration", &vision::write_calibration, py::arg("file"), py::arg("calibration"));
  module.def(
      "read_grey", [](const path& file) { return array_of(vision::read_grey_image(file)); }, py::arg("file"),
      "Reads a PNG or JPEG of any colour type as grey, uint8 or uint16.");
  module.def(
      "read_color", [](const path& file) { return array_of(vision::read_color_image(file)); }, py::arg("file"),
      "Reads a PNG or JPEG as RGB, H x W x 3 of uint8.");
  module.def("_write_ply", &write_ply, py::arg("file"), py::arg("points"), py::arg("bgr"), py::arg("normals"),
             py::arg("is_new") = false);
  module.def("_point_cloud", &point_cloud, py::arg("disparity"), py::arg("variance"), py::arg("bgr"),
             py::arg("calibration"), py::arg("max_relative_sigma"), py::arg("max_depth_m"), py::arg("max_jump_px"),
             py::arg("kept"), py::arg("reasons"));
  module.def(
      "read_disparity", [](const path& file) { return array_of(vision::read_disparity(file)); }, py::arg("file"),
      "Reads KITTI's PNG, a PFM or .npy into float32; INVALID_DISPARITY where there is none.");
  module.def("write_disparity", &write_disparity, py::arg("file"), py::arg("disparity"),
             "Writes KITTI's PNG or a PFM by the extension. Returns how many disparities the format has no room for.");
  module.def("write_pfm", &write_pfm, py::arg("file"), py::arg("map"), "Writes any map; infinity where invalid.");
  module.def(
      "read_poses", [](const path& file) { return array_of(vision::read_poses(file)); }, py::arg("file"),
      "Reads KITTI poses, camera-to-world: (N, 4, 4).");
  module.def(
      "write_poses",
      [](const path& file, const py::object& poses) { vision::write_poses(file, transforms_of(poses, "poses")); },
      py::arg("file"), py::arg("world_from_camera"));
}

}  // namespace egosgm::python
