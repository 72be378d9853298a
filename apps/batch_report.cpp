// SPDX-License-Identifier: Apache-2.0
#include "apps/batch_report.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>

#include <utility>

#include "apps/metrics_json.h"
#include "apps/output_folder.h"
#include "apps/run_outputs.h"
#include "egosgm/error.h"
#include "egosgm/named_options.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/evaluation.h"
#include "host/json_text.h"
#include "host/vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using vision::DisparityCounts;

constexpr std::size_t kMaxReportBytes = std::size_t{1} << 30;

constexpr std::pair<const char*, std::int64_t DisparityCounts::*> kCounts[] = {
    {"truth", &DisparityCounts::truth},
    {"valid", &DisparityCounts::valid},
    {"bad", &DisparityCounts::bad},
    {"d1", &DisparityCounts::d1},
    {"bad_interpolated", &DisparityCounts::bad_interpolated},
    {"d1_interpolated", &DisparityCounts::d1_interpolated}};

Json json_of(const DisparityCounts& counts) {
  Json json;
  for (const auto& [name, count] : kCounts) json[name] = counts.*count;
  json["absolute_error_px"] = counts.absolute_error_px;
  return json;
}

DisparityCounts counts_of(const Json& json) {
  DisparityCounts counts;
  for (const auto& [name, count] : kCounts) counts.*count = json.at(name);
  counts.absolute_error_px = json.at("absolute_error_px");
  return counts;
}

Json read(const fs::path& file) {
  Json json = parse_json(vision::read_file(file, kMaxReportBytes), file);
  if (!json.is_object()) {
    throw InvalidArgument(file.string() + ": is not what egosgm batch wrote: move it away, or choose another --out");
  }
  json.erase("digest");
  return json;
}

/// Of the frames that have truth of that kind.
DisparityCounts compare(const SequenceJob& job, fs::path vision::StereoFrame::*truth) {
  DisparityCounts counts;
  for (const vision::StereoFrame& frame : job.sequence.frames) {
    if ((frame.*truth).empty()) continue;
    counts += vision::compare_disparity(
        vision::read_disparity(job.out.path() / output_file("disparity", frame.name, job.options)),
        vision::read_disparity(frame.*truth));
  }
  return counts;
}

double mean(const Json& frames, const char* figure) {
  double sum = 0;
  for (const Json& frame : frames) sum += frame.at(figure).get<double>();
  return frames.empty() ? 0 : sum / static_cast<double>(frames.size());
}

/// The first setting that differs.
std::string difference(const Json& there, const Json& here) {
  const Json before = there.flatten(), now = here.flatten();
  for (const auto& [name, value] : now.items()) {
    if (!before.contains(name)) return fmt::format("without {}", name.substr(1));
    if (before[name] != value) {
      return fmt::format("with {} = {}, now it is {}", name.substr(1), before[name].dump(), value.dump());
    }
  }
  return "with more";
}

}  // namespace

Json batch_settings(const PipelineOptions& options, const StereoOdometryOptions& odometry,
                    const std::set<std::string>& kinds) {
  Json json{{"version", EGOSGM_VERSION},
            {"write", kinds},
            {"odometry",
             {{"max_translation_m", odometry.max_translation_m}, {"max_rotation_deg", odometry.max_rotation_deg}}},
            {"options", Json::object()}};
  for (const auto& [name, value] : list_options(options)) json["options"][name] = value;
  return json;
}

BatchFolder::BatchFolder(const std::string& folder, Json settings, bool overwrite)
    : folder_(folder), settings_(std::move(settings)), overwrite_(overwrite) {
  if (folder.empty()) throw InvalidArgument("--out \"\": give a name");
  for (const char* name : {"settings.json", "batch.json"}) expect_own_json(folder_ / name);
  const fs::path file = folder_ / "settings.json";
  if (overwrite_ || !fs::exists(file)) return;
  const Json there = read(file);
  if (there == settings_) return;
  throw InvalidArgument(fmt::format("{}: this batch was begun {}: give the same options, or another --out", folder,
                                    difference(there, settings_)));
}

void BatchFolder::begin(bool is_shard) {
  vision::make_folder(folder_);
  lock_ = std::make_unique<LockedFile>(folder_ / ".", O_RDONLY | O_DIRECTORY, is_shard ? LOCK_SH : LOCK_EX);
  write_own_json(folder_ / "settings.json", settings_);
}

EarlierRun BatchFolder::treatment_of(const BatchEntry& entry) const {
  for (const char* name : {"done.json", "failed.json"}) expect_own_json(folder_of(entry) / name);
  const fs::path report = folder_of(entry) / "report.json";
  std::error_code none;
  if (overwrite_ || !fs::exists(report, none)) return overwrite_ ? EarlierRun::kOverwrite : EarlierRun::kRefuse;
  expect_own_json(report);
  const Json earlier = read(report);
  const bool is_ours = earlier.value("batch_input", Json()) == as_in_file(entry.arguments);
  return is_ours ? EarlierRun::kOverwrite : EarlierRun::kRefuse;
}

bool BatchFolder::is_done(const BatchEntry& entry) const {
  const fs::path file = folder_of(entry) / "done.json";
  if (!fs::exists(file)) return false;
  expect_own_json(file);
  const Json done = read(file);
  const std::string before = done.value("input", "");
  if (Json(before) == as_in_file(entry.arguments)) return done.value("settings", "") == digest_of(dumped(settings_));
  throw InvalidArgument(fmt::format(R"({} holds the results of "{}", the list now says "{}": choose another name)",
                                    folder_of(entry).string(), before, entry.arguments));
}

void BatchFolder::begin(const BatchEntry& entry) const {
  vision::make_folder(folder_of(entry));
  std::error_code ignored;
  for (const char* name : {"done.json", "failed.json"}) fs::remove(folder_of(entry) / name, ignored);
}

Json BatchFolder::finish(const BatchEntry& entry, const SequenceJob& job) const {
  const Json report = read(job.out.path() / "report.json");
  const Json& frames = report.at("frames");
  Json done{{"input", entry.arguments},
            {"settings", digest_of(dumped(settings_))},
            {"title", job.sequence.title},
            {"width", report.at("width")},
            {"height", report.at("height")},
            {"frames", frames.size()},
            {"search_fraction", mean(frames, "search_fraction")},
            {"density", mean(frames, "density")},
            {"noc", json_of(compare(job, &vision::StereoFrame::truth_noc))},
            {"occ", json_of(compare(job, &vision::StereoFrame::truth_occ))}};
  if (report.contains("doubt")) done["doubt"] = report["doubt"];
  write_own_json(folder_of(entry) / "done.json", done);
  return done;
}

void BatchFolder::fail(const BatchEntry& entry, const std::string& reason) const {
  write_own_json(folder_of(entry) / "failed.json", {{"input", entry.arguments}, {"reason", reason}});
}

Json BatchFolder::result_of(const BatchEntry& entry) const {
  Json result{{"name", entry.name}};
  if (is_done(entry)) {
    result.update(read(folder_of(entry) / "done.json"));
    result.erase("settings");
    return result;
  }
  const fs::path failed = folder_of(entry) / "failed.json";
  result["input"] = entry.arguments;
  result["failed"] = fs::exists(failed) ? read(failed).value("reason", "") : "not run to its end with these options";
  return result;
}

Json BatchFolder::write_report(const std::vector<BatchEntry>& entries) const {
  Json report = read(folder_ / "settings.json");
  Json sequences = Json::array();
  std::int64_t frames = 0, done = 0;
  DisparityCounts noc, occ;
  for (const BatchEntry& entry : entries) {
    Json result = result_of(entry);
    if (!result.contains("failed")) {
      ++done;
      frames += result.at("frames").get<std::int64_t>();
      noc += counts_of(result.at("noc"));
      occ += counts_of(result.at("occ"));
    }
    sequences.push_back(std::move(result));
  }
  report["sequences_done"] = done;
  report["sequences_failed"] = static_cast<std::int64_t>(entries.size()) - done;
  report["frames"] = frames;
  report["pooled"] = {{"noc", app::json_of(vision::metrics_of(noc))}, {"occ", app::json_of(vision::metrics_of(occ))}};
  report["sequences"] = std::move(sequences);
  write_own_json(folder_ / "batch.json", report);
  return report;
}

}  // namespace egosgm::app
