// SPDX-License-Identifier: Apache-2.0
#include "apps/run_outputs.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
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
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

const std::vector<std::string> kKinds{
    "variance", "color",   "predicted", "measured", "right",    "interpolated", "interpolated_certain",
    "search",   "dynamic", "reason",    "pfm",      "overview", "cloud",        "depth",
    "depth_m",  "left"};

const std::set<std::string> kDisparities{"disparity", "predicted",    "measured",
                                         "right",     "interpolated", "interpolated_certain"};

/// KITTI's PNG has values above 0 and below 256 px.
bool fits_png(const PipelineOptions& options) {
  return options.min_disparity >= 0 && options.min_disparity + options.disparities <= 256;
}

const char* extension_of(const std::string& kind, const PipelineOptions& options) {
  if (kind == "variance" || kind == "pfm" || kind == "depth_m") return ".pfm";
  if (kDisparities.contains(kind) && !fits_png(options)) return ".pfm";
  return kind == "cloud" ? ".ply" : ".png";
}

template <typename T>
MapView<T> view_of(vision::Image& map) {
  return {map.row<T>(0), map.cols, map.rows, static_cast<std::ptrdiff_t>(map.stride_bytes)};
}

}  // namespace

const char* const kWriteListHelp =
    "more to write, separated by commas:\n"
    "  variance       variance [px^2], PFM\n"
    "  pfm            disparity as float, PFM: also negative ones and those above 256\n"
    "  right, predicted, measured, interpolated\n"
    "                 these disparity maps, in the format of OUT/disparity\n"
    "  interpolated_certain\n"
    "                 the same, but variances above 6 px^2 become holes before they are filled: of a video a little "
    "better\n"
    "  search         disparities searched at each pixel, 16-bit PNG\n"
    "  dynamic        255 where prediction and measurement contradict each other, as on what moves by itself, 8-bit "
    "PNG\n"
    "  reason         why a pixel has no value, or a doubtful one: a number each, 8-bit PNG (docs/use/formats.md)\n"
    "  color          disparity in colours, PNG\n"
    "  overview       image, disparity, search width and error (or variance) in one PNG\n"
    "  cloud          points with colours [m], PLY, without those whose depth is uncertain (--cloud-sigma)\n"
    "  depth, depth_m depth in millimetres, 16-bit PNG, 0 where there is none or more than 65.535 m; in metres, PFM\n"
    "  left           the left images as they are matched, grey PNG; always of a bag";

std::set<std::string> parse_write_list(const std::string& list) {
  std::set<std::string> kinds;
  std::istringstream stream(list);
  for (std::string part; std::getline(stream, part, ',');) {
    const std::string kind = CLI::detail::trim_copy(part);
    if (kind == "disparity") continue;  // always written
    if (std::find(kKinds.begin(), kKinds.end(), kind) == kKinds.end()) {
      std::string all;
      for (const std::string& known : kKinds) all += (all.empty() ? "" : ", ") + known;
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
    for (const std::string& kind : kinds) files.push_back(output_file(kind, frame.name, options));
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
      disparity_(size, vision::kF32),
      panels_(options.disparities) {
  if (!folder_.empty()) {
    vision::make_folder(folder_ / "disparity");
    for (const std::string& kind : kinds_) vision::make_folder(folder_ / kind);
  }
  if (wants("variance") || wants("overview") || wants("cloud") || wants("interpolated_certain"))
    variance_.create(size, vision::kF32);
  if (wants("right")) right_.create(size, vision::kF32);
  if (wants("predicted")) predicted_.create(size, vision::kF32);
  if (wants("measured")) measured_.create(size, vision::kF32);
  if (wants("search") || wants("overview")) search_.create(size, vision::kU16);
  if (wants("dynamic")) dynamic_.create(size, vision::kU8);
  if (wants("reason")) reason_.create(size, vision::kU8);
}

void RunOutputs::make_shown_maps() {
  variance_.create(size_, vision::kF32);
  reason_.create(size_, vision::kU8);
}

FrameOutputs RunOutputs::views() {
  FrameOutputs outputs;
  outputs.disparity = vision::map_view(disparity_);
  if (!variance_.empty()) outputs.variance = vision::map_view(variance_);
  if (!right_.empty()) outputs.right_disparity = vision::map_view(right_);
  if (!predicted_.empty()) outputs.debug.predicted = vision::map_view(predicted_);
  if (!measured_.empty()) outputs.debug.measured = vision::map_view(measured_);
  if (!search_.empty()) outputs.debug.search_width = view_of<std::uint16_t>(search_);
  if (!dynamic_.empty()) outputs.debug.dynamic = view_of<std::uint8_t>(dynamic_);
  if (!reason_.empty()) outputs.reason = view_of<std::uint8_t>(reason_);
  return outputs;
}

WrittenFrame RunOutputs::write(const vision::StereoFrame& frame, const vision::Image& left) {
  using Path = std::filesystem::path;
  WrittenFrame written;
  const auto depth_m = [&] { return vision::depth_from_disparity(disparity_, calibration_); };
  const std::pair<const char*, std::function<void(const Path&)>> writers[] = {
      {"left",
       [&](const Path& path) { vision::write_png(path, left); }},  // first: a cloud takes its colours from there
      {"variance", [&](const Path& path) { vision::write_pfm(path, variance_); }},
      {"pfm", [&](const Path& path) { vision::write_pfm(path, disparity_); }},
      {"predicted", [&](const Path& path) { vision::write_disparity(path, predicted_); }},
      {"measured", [&](const Path& path) { vision::write_disparity(path, measured_); }},
      {"right", [&](const Path& path) { vision::write_disparity(path, right_); }},
      {"search", [&](const Path& path) { vision::write_png(path, search_); }},
      {"dynamic", [&](const Path& path) { vision::write_png(path, dynamic_); }},
      {"reason", [&](const Path& path) { vision::write_png(path, reason_); }},
      {"overview",
       [&](const Path& path) {
         vision::write_png(path, panels_.overview({frame, left, disparity_, variance_, search_}));
       }},
      {"interpolated",
       [&](const Path& path) { vision::write_disparity(path, vision::interpolate_background(disparity_)); }},
      {"interpolated_certain",
       [&](const Path& path) {
         const vision::Image certain = vision::drop_uncertain(disparity_, variance_);
         vision::write_disparity(path, vision::interpolate_background(certain));
       }},
      {"color", [&](const Path& path) { vision::write_png(path, panels_.disparity(disparity_)); }},
      {"cloud",
       [&](const Path& path) {
         const vision::Image colors = vision::read_color_image(frame.left);
         const vision::PointCloud cloud = vision::point_cloud(disparity_, variance_, colors, calibration_, cloud_);
         vision::write_ply(path, cloud);
         written.cloud = {static_cast<std::int64_t>(cloud.points_m.size()), cloud.left_out};
       }},
      {"depth",
       [&](const Path& path) {
         const std::int64_t too_far = vision::write_depth_png(path, depth_m());
         if (!wants("depth_m")) written.too_far = too_far;
       }},
      {"depth_m", [&](const Path& path) { vision::write_pfm(path, depth_m()); }}};
  for (const auto& [kind, write] : writers) {
    if (wants(kind)) write(folder_ / output_file(kind, frame.name, options_));
  }
  // Last: a frame with it is complete.
  written.unstorable = vision::write_disparity(folder_ / output_file("disparity", frame.name, options_), disparity_);
  return written;
}

}  // namespace egosgm::app
