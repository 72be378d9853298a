// SPDX-License-Identifier: Apache-2.0
#include "apps/run_outputs.h"

#include <fmt/core.h>

#include <CLI/StringTools.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <sstream>
#include <utility>
#include <vector>

#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/evaluation.h"
#include "egosgm/vision/image.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/point_cloud.h"
#include "egosgm/vision/render.h"
#include "host/frame_outputs.h"
#include "vision/file_io.h"
#include "vision/object_table.h"

namespace egosgm::app {
namespace {

/// What is made of a frame's maps. Outputs that are written as they are stand in the table of outputs.
const std::vector<std::string> kMade{
    "color", "interpolated", "interpolated_certain", "pfm", "overview", "cloud", "depth", "depth_m", "left"};

/// What is made of a frame and the one after it: the last frame has none.
const std::vector<std::string> kSceneFlow{"flow", "disp_1", "objects"};

bool is_scene_flow(const std::string& kind) {
  return std::find(kSceneFlow.begin(), kSceneFlow.end(), kind) != kSceneFlow.end();
}

/// All that `--write` takes.
std::vector<std::string> kinds_to_write() {
  std::vector<std::string> kinds;
  for (const OutputText& text : output_texts()) {
    if (*text.written && text.output != Output::kDisparity) kinds.emplace_back(text.written);  // that is always written
  }
  kinds.insert(kinds.end(), kMade.begin(), kMade.end());
  kinds.insert(kinds.end(), kSceneFlow.begin(), kSceneFlow.end());
  return kinds;
}

/// KITTI's PNG has values above 0 and below 256 px.
bool fits_png(const PipelineOptions& options) {
  return options.min_disparity >= 0 && options.min_disparity + options.disparities <= 256;
}

const char* extension_of(const std::string& kind, const PipelineOptions& options) {
  bool is_disparity = kind.starts_with("interpolated") || kind == "disp_1",
       is_float = is_disparity || kind == "pfm" || kind == "depth_m";
  for (const OutputText& text : output_texts()) {
    if (kind != text.written) continue;
    is_disparity = text.unit == std::string("px");
    is_float = text.values == std::string("float32");
  }
  if (is_float && !(is_disparity && fits_png(options))) return ".pfm";
  return kind == "cloud" ? ".ply" : ".png";
}

}  // namespace

std::string write_list_help() {
  std::string help = "more to write, separated by commas:\n";
  for (const OutputText& text : output_texts()) {
    if (!*text.written || text.output == Output::kDisparity) continue;
    const std::string unit = text.unit, values = text.values;
    const std::string format = unit == "px"          ? "as OUT/disparity"
                               : values == "float32" ? "PFM"
                               : values == "uint16"  ? "16-bit PNG"
                                                     : "8-bit PNG";
    help +=
        fmt::format("  {:<14} {}{}, {}\n", text.written, text.meaning, unit.empty() ? "" : " [" + unit + "]", format);
  }
  return help +
         "  pfm            disparity as float, PFM: also negative ones and those above 256\n"
         "  interpolated   the disparity with its holes filled, in the format of OUT/disparity\n"
         "  interpolated_certain\n"
         "                 the same, but variances above 6 px^2 become holes before they are filled: of a video a "
         "little "
         "better\n"
         "  color          disparity in colours, PNG\n"
         "  overview       image, disparity, search width and error (or variance) in one PNG\n"
         "  cloud          points with colours [m], PLY, without those whose depth is uncertain (--cloud-sigma)\n"
         "  depth, depth_m depth in millimetres, 16-bit PNG, 0 where there is none or more than 65.535 m; in metres, "
         "PFM\n"
         "  left           the left images as they are matched, grey PNG; always of a bag\n"
         "  flow, disp_1   optical flow to the next frame, KITTI's PNG, and the disparity there at this frame's "
         "pixels, as "
         "OUT/disparity\n"
         "  objects        the id of the object that moves by itself, 8-bit PNG, and OUT/objects.csv with their "
         "motions\n"
         "What the numbers of reason and the formats mean: docs/use/formats.md";
}

std::set<std::string> parse_write_list(const std::string& list) {
  std::set<std::string> kinds;
  const std::vector<std::string> known = kinds_to_write();
  std::istringstream stream(list);
  for (std::string part; std::getline(stream, part, ',');) {
    const std::string kind = CLI::detail::trim_copy(part);
    if (kind == "disparity") continue;  // always written
    if (std::find(known.begin(), known.end(), kind) == known.end()) {
      std::string all;
      for (const std::string& each : known) all += (all.empty() ? "" : ", ") + each;
      throw InvalidArgument(fmt::format("--write \"{}\": choose from {}", kind, all));
    }
    kinds.insert(kind);
  }
  return kinds;
}

std::string output_file(const std::string& kind, const std::string& frame, const PipelineOptions& options) {
  return kind + '/' + frame + extension_of(kind, options);
}

std::vector<std::string> output_files(const std::set<std::string>& kinds, const vision::StereoSequence& sequence,
                                      const PipelineOptions& options) {
  std::vector<std::string> files;
  for (const vision::StereoFrame& frame : sequence.frames) {
    for (const std::string& kind : kinds) {
      if (is_scene_flow(kind) && &frame == &sequence.frames.back()) continue;
      files.push_back(output_file(kind, frame.name, options));
    }
    files.push_back(output_file("disparity", frame.name, options));
  }
  return files;
}

RunOutputs::RunOutputs(std::filesystem::path folder, std::set<std::string> kinds, vision::Size size,
                       const PipelineOptions& options, const Calibration& calibration,
                       const vision::PointCloudOptions& cloud)
    : folder_(std::move(folder)),
      size_(size),
      kinds_(std::move(kinds)),
      options_(options),
      calibration_(calibration),
      cloud_(cloud),
      panels_(options.disparities) {
  if (!folder_.empty()) {
    vision::make_folder(folder_ / "disparity");
    for (const std::string& kind : kinds_) vision::make_folder(folder_ / kind);
  }
  Wanted wanted{Output::kDisparity};
  for (const OutputText& text : output_texts()) {
    if (wants(text.written)) wanted.add(text.output);
  }
  if (wants("overview") || wants("cloud") || wants("interpolated_certain")) wanted.add(Output::kVariance);
  if (wants("overview")) wanted.add(Output::kSearchWidth);
  if (std::any_of(kinds_.begin(), kinds_.end(), is_scene_flow)) {
    wanted.add(Output::kDynamic);
    tracker_.emplace(calibration);
    objects_ = fmt::format("{},age,pixels,sx_m,sy_m,sz_m\n", vision::kObjectColumns);
  }
  make_maps(wanted);
}

void RunOutputs::make_maps(const Wanted& wanted) {
  for_each_output(outputs_, [&]<typename T>(const OutputText& text, MapView<T>& view) {
    if (!wanted.has(text.output)) return;
    vision::Image& map = maps_[static_cast<std::size_t>(text.output)];
    map.create(size_, std::is_same_v<T, float> ? vision::kF32 : sizeof(T) == 2 ? vision::kU16 : vision::kU8);
    view = {map.row<T>(0), map.cols, map.rows, static_cast<std::ptrdiff_t>(map.stride_bytes)};
  });
}

void RunOutputs::write_scene_flow(const vision::StereoFrame& frame, const vision::Image& left,
                                  const std::optional<Motion>& motion) {
  found_ = tracker_->process(left, map(Output::kDisparity), map(Output::kDynamic), motion);
  const std::string from = std::exchange(last_frame_, frame.name);
  const std::optional<vision::SceneFlow> flow = tracker_->scene_flow();
  if (!flow) return;
  const auto file_of = [&](const char* kind) { return folder_ / output_file(kind, from, options_); };
  if (wants("flow")) vision::write_flow_png(file_of("flow"), flow->flow);
  if (wants("disp_1")) vision::write_disparity(file_of("disp_1"), flow->next_disparity);
  if (!wants("objects")) return;
  vision::write_png(file_of("objects"), flow->labels);
  for (const vision::MovingObject& object : flow->moving) {
    objects_ += vision::object_row(from, object, object.current_from_previous);
    objects_ += fmt::format(",{},{}", object.age, object.pixels);
    for (const double variance : object.velocity_covariance_m2.diagonal()) {
      objects_ += fmt::format(",{:.6g}", std::sqrt(variance));
    }
    objects_ += '\n';
  }
}

WrittenFrame RunOutputs::write(const vision::StereoFrame& frame, const vision::Image& left,
                               const std::optional<Motion>& motion) {
  using Path = std::filesystem::path;
  WrittenFrame written;
  const vision::Image &disparity = map(Output::kDisparity), &variance = map(Output::kVariance);
  const auto depth_m = [&] { return vision::depth_from_disparity(disparity, calibration_); };
  const std::pair<const char*, std::function<void(const Path&)>> writers[] = {
      {"left",
       [&](const Path& path) { vision::write_png(path, left); }},  // first: a cloud takes its colours from there
      {"pfm", [&](const Path& path) { vision::write_pfm(path, disparity); }},
      {"overview",
       [&](const Path& path) {
         vision::write_png(path, panels_.overview({frame, left, disparity, variance, map(Output::kSearchWidth)}));
       }},
      {"interpolated",
       [&](const Path& path) { vision::write_disparity(path, vision::interpolate_background(disparity)); }},
      {"interpolated_certain",
       [&](const Path& path) {
         const vision::Image certain = vision::drop_uncertain(disparity, variance);
         vision::write_disparity(path, vision::interpolate_background(certain));
       }},
      {"color", [&](const Path& path) { vision::write_png(path, panels_.disparity(disparity)); }},
      {"cloud",
       [&](const Path& path) {
         const vision::Image colors = vision::read_color_image(frame.left);
         const vision::PointCloud cloud = vision::point_cloud(disparity, variance, colors, calibration_, cloud_);
         vision::write_ply(path, cloud);
         written.cloud = {static_cast<std::int64_t>(cloud.points_m.size()), cloud.left_out};
       }},
      {"depth",
       [&](const Path& path) {
         const std::int64_t too_far = vision::write_depth_png(path, depth_m());
         if (!wants("depth_m")) written.too_far = too_far;
       }},
      {"depth_m", [&](const Path& path) { vision::write_pfm(path, depth_m()); }}};
  const auto file_of = [&](const char* kind) { return folder_ / output_file(kind, frame.name, options_); };
  for (const auto& [kind, write] : writers) {
    if (wants(kind)) write(file_of(kind));
  }
  for (const OutputText& text : output_texts()) {
    if (!wants(text.written)) continue;
    const vision::Image& values = map(text.output);
    if (values.type == vision::kF32) {
      vision::write_disparity(file_of(text.written), values);
    } else {
      vision::write_png(file_of(text.written), values);
    }
  }
  if (tracker_) write_scene_flow(frame, left, motion);
  // Last: a frame with it is complete.
  written.unstorable = vision::write_disparity(file_of("disparity"), disparity);
  return written;
}

}  // namespace egosgm::app
