// SPDX-License-Identifier: Apache-2.0
#include "apps/run_report.h"

#include <fmt/core.h>

#include "egosgm/named_options.h"
#include "host/json_text.h"
#include "vision/file_io.h"

namespace egosgm::app {
namespace {

using Json = nlohmann::ordered_json;

Json typed(const std::string& value) {
  Json parsed = Json::parse(value, nullptr, /*allow_exceptions=*/false);
  return parsed.is_discarded() ? Json(value) : parsed;
}

Json json_of(const PipelineOptions& options) {
  Json json = Json::object();
  for (const auto& [name, value] : list_options(options)) json[name] = typed(value);
  return json;
}

Json json_of(const Calibration& c) {
  return {
      {"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx}, {"cy", c.cy}, {"baseline_m", c.baseline_m}, {"doffs_px", c.doffs_px}};
}

Json odometry_json(const vision::FrameMotion& motion) {
  Json json{{"source", motion.is_given ? "poses file" : "estimated"}};
  if (!motion.is_given) {
    json["features"] = motion.odometry.features;
    json["matches"] = motion.odometry.matches;
    json["inliers"] = motion.odometry.inliers;
    json["reprojection_rms_px"] = motion.odometry.reprojection_rms_px;
    json["reason"] = motion.odometry.reason;
  }
  json["motion"] = motion.motion ? app::json_of(motion.motion->current_from_previous) : Json();
  return json;
}

/// A stage that runs more than once in a frame (the consistency checks) has its times added up.
Json times_json(const FrameReport& report, const vision::FrameMotion& motion, const HostTimes& times) {
  Json json = Json::object();
  for (const StageTime& stage : report.stages) json[stage.stage] = json.value(stage.stage, 0.0) + stage.ms;
  json["total"] = report.total_ms;
  json["odometry"] = motion.odometry_ms;
  json["read"] = times.read_ms;
  json["write"] = times.write_ms;
  json["wall"] = times.wall_ms;
  return json;
}

}  // namespace

Json json_of(const DeviceInfo& info) {
  return {{"name", info.name},
          {"type", to_string(info.type)},
          {"vendor", info.vendor},
          {"platform", info.platform},
          {"version", info.version},
          {"driver", info.driver},
          {"compute_units", info.compute_units}};
}

nlohmann::ordered_json json_of(const Eigen::Isometry3d& motion) {
  const Eigen::Vector3d& t = motion.translation();
  Json matrix = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) matrix.push_back(motion.matrix()(row, column));
  }
  constexpr double degrees = 180.0 / 3.14159265358979323846;
  return {{"translation_m", {t.x(), t.y(), t.z()}},
          {"rotation_deg", Eigen::AngleAxisd(motion.rotation()).angle() * degrees},
          {"current_from_previous", matrix}};
}

RunReport::RunReport(const vision::StereoSequence& sequence, const Pipeline& pipeline, const std::string& motion,
                     int width, int height) {
  const DeviceInfo& device = pipeline.device().info();
  json_ = {{"program", "egosgm"},
           {"version", EGOSGM_VERSION},
           {"input", sequence.title},
           {"first_frame", sequence.frames.front().number},
           {"sequence", Json()},
           {"motion", motion},
           {"width", width},
           {"height", height},
           {"calibration", json_of(sequence.calibration)},
           {"device", json_of(device)},
           {"driver", device.driver},
           {"device_memory_bytes", pipeline.device_memory_bytes()},
           {"options", json_of(pipeline.options())},
           {"finished", false},
           {"frames", Json::array()}};
  if (sequence.numbers.empty()) return;
  json_["sequence"] = {{"first_frame", sequence.numbers.front()},
                       {"last_frame", sequence.numbers.back()},
                       {"frames", sequence.numbers.size()}};
}

Json RunReport::identity() const {
  Json identity;
  for (const char* key :
       {"version", "input", "first_frame", "motion", "width", "height", "calibration", "device", "options"}) {
    identity[key] = json_.at(key);
  }
  if (json_.contains("fallback")) identity.erase("device");
  return identity;
}

void RunReport::take_over(const LostDevice& from) {
  json_["fallback"] = {{"from", json_of(from.device)}, {"why", from.why}};
}

void RunReport::add(const vision::VideoFrame& made, const HostTimes& times, const WrittenFrame& written) {
  const FrameReport& report = made.report;
  const vision::StereoFrame& frame = made.pair.frame;
  json_["frames"].push_back({{"frame", frame.number},
                             {"left", std::filesystem::absolute(frame.left).string()},
                             {"search_fraction", report.search_fraction},
                             {"predicted_fraction", report.predicted_fraction},
                             {"density", report.density},
                             {"vertical_offset_px", report.vertical_offset_px},
                             {"unpredicted", to_string(report.unpredicted)},
                             {"repeated", report.repeated},
                             {"searched_everything", report.searched_everything},
                             {"odometry", odometry_json(made.motion)},
                             {"launches", report.launches},
                             {"stripes", report.stripes},
                             {"outside_png_range", written.unstorable},
                             {"ms", times_json(report, made.motion, times)}});
  if (const auto& cloud = written.cloud) {
    const vision::LeftOut& out = cloud->left_out;
    json_["frames"].back()["cloud"] = {
        {"points", cloud->points},
        {"left_out", {{"far", out.far}, {"uncertain", out.uncertain}, {"alone", out.alone}}}};
  }
  if (made.pair.stamp_ns) json_["frames"].back()["stamp_ns"] = *made.pair.stamp_ns;
  if (frame.name != fmt::format("{:06}", frame.number)) json_["frames"].back()["name"] = frame.name;
}

void RunReport::add_reasons() {
  for (int reason = 0; reason < kReasonCount; ++reason) {
    json_["reasons"].push_back(to_string(static_cast<Reason>(reason)));
  }
}

void RunReport::leave_out(const vision::StereoFrame& frame, const std::string& why) {
  json_["left_out"].push_back({{"frame", frame.number}, {"name", frame.name}, {"why", why}});
}

void RunReport::set_warning(const std::string& warning, const std::vector<std::string>& notes) {
  if (!warning.empty()) json_["warning"] = warning;
  if (!notes.empty()) json_["notes"] = notes;
}

void RunReport::write(const std::filesystem::path& file, bool finished, const std::string& why_not) {
  json_["finished"] = finished;
  json_.erase("stopped_by");
  if (!finished) json_["stopped_by"] = why_not;
  vision::write_file(file, dumped(json_, 2) + "\n");
}

double RunReport::mean(const char* figure) const {
  double sum = 0;
  for (const Json& frame : json_["frames"]) sum += std::min(1.0, frame[figure].get<double>());
  return json_["frames"].empty() ? 0 : sum / static_cast<double>(json_["frames"].size());
}

}  // namespace egosgm::app
