// SPDX-License-Identifier: Apache-2.0
// One HTML page of a run, which needs no other file and no network.
#include <fmt/core.h>

#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <set>
#include <sstream>

#include "apps/command.h"
#include "apps/frame_panels.h"
#include "apps/media.h"
#include "apps/metrics_json.h"
#include "apps/output_folder.h"
#include "apps/python_tools.h"
#include "apps/run_folder.h"
#include "apps/truth_pairs.h"
#include "egosgm/error.h"
#include "egosgm/named_options.h"
#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/evaluation.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/poses_io.h"
#include "host/json_text.h"
#include "host/vision/file_io.h"
#include "host/vision/pair_with_truth.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxReportBytes = std::size_t{1} << 30;
constexpr std::size_t kPictures = 6;

struct ReportArguments {
  std::string run, truth, poses, frames, pictures, out;
  int picture_width = 1242;
};

Json read_run(const fs::path& folder) {
  const fs::path file = folder / "report.json";
  if (!fs::exists(file)) {
    throw MissingPath(file.string(), "no such file: give the folder that `egosgm run --out` wrote");
  }
  Json run = parse_json(vision::read_file(file, kMaxReportBytes), file);
  if (run.is_discarded()) throw InvalidArgument(file.string() + ": is no JSON: it was cut or edited; run it again");
  const auto has = [&](const char* key) { return run.is_object() && run.contains(key); };
  for (const char* key : {"input", "version", "device", "calibration", "options", "frames"}) {
    if (!has(key)) throw InvalidArgument(file.string() + ": not the report of a run: it has no \"" + key + "\"");
  }
  if (run["frames"].empty()) {
    throw InvalidArgument(file.string() +
                          ": lists no frame, as the run was killed, is under way, or was stopped before "
                          "its first: let it end, or run it again with --resume");
  }
  return run;
}

/// The sequence as far as the run's report tells, with the left images that are still there.
vision::StereoSequence sequence_of(const fs::path& folder) {
  std::optional<vision::StereoSequence> sequence = frames_of_run(folder);
  if (!sequence)
    throw InvalidArgument((folder / "report.json").string() + ": not the report of a run: its frames have no numbers");
  for (vision::StereoFrame& frame : sequence->frames) {
    if (!fs::exists(frame.left)) frame.left.clear();
  }
  return std::move(*sequence);
}

/// Indices of the frames that are shown.
std::vector<std::size_t> chosen_frames(const vision::StereoSequence& sequence, const std::string& list) {
  const std::size_t count = sequence.frames.size();
  std::set<std::size_t> chosen;
  if (list.empty()) {
    const std::size_t wanted = std::min(kPictures, count);
    for (std::size_t i = 0; i < wanted; ++i) chosen.insert(wanted == 1 ? 0 : i * (count - 1) / (wanted - 1));
  }
  std::istringstream stream(list);
  for (std::string text; std::getline(stream, text, ',');) {
    const auto found = std::find_if(sequence.frames.begin(), sequence.frames.end(), [&](const auto& frame) {
      return text == std::to_string(frame.number) || text == frame.name;
    });
    if (found == sequence.frames.end()) {
      throw InvalidArgument(fmt::format("--pictures \"{}\": the run has no such frame: choose from {} to {}", text,
                                        sequence.frames.front().number, sequence.frames.back().number));
    }
    chosen.insert(static_cast<std::size_t>(found - sequence.frames.begin()));
  }
  return {chosen.begin(), chosen.end()};
}

std::string base64(const std::vector<std::uint8_t>& bytes) {
  constexpr const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto at = [&](std::size_t k) { return k < bytes.size() ? std::uint32_t{bytes[k]} : 0u; };
    const std::uint32_t group = at(i) << 16 | at(i + 1) << 8 | at(i + 2);
    for (int shift = 18; shift >= 0; shift -= 6) text += digits[group >> shift & 63];
  }
  const std::size_t missing = (3 - bytes.size() % 3) % 3;
  text.replace(text.size() - missing, missing, missing, '=');
  return text;
}

std::string data_uri(const cv::Mat& picture, const char* kind) {
  std::vector<std::uint8_t> bytes;
  media().encode_image(fmt::format(".{}", kind), picture, bytes, {cv::IMWRITE_JPEG_QUALITY, 92});
  return fmt::format("data:image/{};base64,{}", kind, base64(bytes));
}

cv::Mat narrowed(const cv::Mat& picture, int width) {
  if (picture.cols <= width) return picture;
  cv::Mat scaled;
  cv::resize(picture, scaled, {width, std::max(1, picture.rows * width / picture.cols)}, 0, 0, cv::INTER_AREA);
  return scaled;
}

/// The text with the last folder and the name of each path in it: a page that is passed on tells nothing of the
/// machine.
std::string without_folders(const std::string& text) {
  constexpr std::string_view kBetween = " and ";
  std::string short_text;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t end = std::min(text.find(kBetween, from), text.size());
    std::string part = text.substr(from, end - from);
    if (const std::size_t root = part.starts_with('/') ? 0 : part.find(" /"); root != std::string::npos) {
      const fs::path path = part.substr(root == 0 ? 0 : root + 1);
      part = part.substr(0, root == 0 ? 0 : root + 1) + (path.parent_path().filename() / path.filename()).string();
    }
    short_text += std::string(from ? kBetween : "") + part;
    from = end + kBetween.size();
  }
  return short_text;
}

void shorten_paths(Json& json) {
  if (json.is_string()) json = without_folders(json.get<std::string>());
  if (!json.is_structured()) return;
  for (Json& inner : json) shorten_paths(inner);  // as deep as parse_json allows
}

/// What the page shows; its script reads it from @DATA@.
class Page {
 public:
  explicit Page(const ReportArguments& arguments)
      : arguments_(arguments),
        folder_(arguments.run),
        run_(read_run(folder_)),
        sequence_(sequence_of(folder_)),
        panels_(run_["options"].value("disparities", 128)) {
    choose_frames();
  }

  std::string html() {
    Json data;
    add_truth(data);
    add_pictures(data);
    add_paths(data);
    data["changed"] = changed_options();
    data["notes"] = notes_;
    shorten_paths(run_);
    data["run"] = std::move(run_);
    std::string json = data.dump(-1, ' ', false, Json::error_handler_t::replace);
    // Nothing in a text may end the script element.
    for (std::size_t at = 0; (at = json.find('<', at)) != std::string::npos;) json.replace(at, 1, "\\u003c");
    std::string page(embedded_files().at("report.html"));
    constexpr std::string_view place = "@DATA@";
    return page.replace(page.find(place), place.size(), json);
  }

 private:
  /// Leaves the frames of --frames in the run's report and in the sequence.
  void choose_frames() {
    const vision::FrameRange range =
        arguments_.frames.empty() ? vision::FrameRange{} : vision::parse_frame_range(arguments_.frames);
    Json entries = Json::array();
    std::vector<vision::StereoFrame> frames;
    for (std::size_t i = 0; i < sequence_.frames.size(); ++i) {
      const int number = sequence_.frames[i].number;
      if (number < range.first.value_or(number) || number > range.last.value_or(number)) continue;
      in_run_.push_back(i);
      entries.push_back(std::move(run_["frames"][i]));
      frames.push_back(std::move(sequence_.frames[i]));
    }
    if (frames.empty()) {
      throw InvalidArgument(fmt::format("--frames {}: the run has none of them: choose from {} to {}",
                                        arguments_.frames, sequence_.frames.front().number,
                                        sequence_.frames.back().number));
    }
    run_["frames"] = std::move(entries);
    sequence_.frames = std::move(frames);
  }

  void add_truth(Json& data) {
    data["metrics"] = Json::object();
    if (arguments_.truth.empty()) {
      notes_.emplace_back("Without truth there are no errors: egosgm report OUT TRUTH compares.");
      return;
    }
    vision::DisparityCounts pooled;
    const vision::EvaluationPairs found = find_truth_pairs(folder_, arguments_.truth, arguments_.frames);
    notes_.push_back(text_of(found));
    for (const vision::EvaluationPair& pair : found.pairs) {
      const auto frame = std::find_if(sequence_.frames.begin(), sequence_.frames.end(),
                                      [&](const auto& f) { return f.name == pair.name; });
      if (frame == sequence_.frames.end()) continue;
      frame->truth_noc = pair.truth;
      const vision::DisparityCounts counts =
          vision::compare_disparity(vision::read_disparity(pair.estimate), vision::read_disparity(pair.truth));
      pooled += counts;
      data["metrics"][std::to_string(frame->number)] = json_of(vision::metrics_of(counts));
    }
    data["pooled"] = json_of(vision::metrics_of(pooled));
  }

  void add_pictures(Json& data) {
    data["pictures"] = Json::array();
    data["bars"] = Json::object();
    for (const std::size_t i : chosen_frames(sequence_, arguments_.pictures)) {
      const vision::StereoFrame& frame = sequence_.frames[i];
      Json layers = Json::array();
      for (const Layer& layer : layers_of(frame)) {
        const bool has_edges = layer.name.starts_with("error") || layer.name == "reason";  // ten colours
        const char* kind = has_edges ? "png" : "jpeg";
        layers.push_back(
            {{"name", layer.name}, {"picture", data_uri(narrowed(layer.picture, arguments_.picture_width), kind)}});
        if (!layer.bar.empty()) data["bars"][layer.name] = data_uri(layer.bar, "png");
      }
      data["pictures"].push_back({{"frame", frame.number}, {"name", frame.name}, {"layers", std::move(layers)}});
    }
    if (sequence_.frames.front().left.empty()) {
      notes_.emplace_back("The left images are not where the report of the run says, so they are not shown.");
    }
    for (const char* kind : {"variance", "search"}) {
      if (!fs::exists(folder_ / kind)) {
        notes_.push_back(fmt::format("The run did not write \"{}\": egosgm run --write variance,search does.", kind));
      }
    }
  }

  std::vector<Layer> layers_of(const vision::StereoFrame& frame) {
    const auto file = [&](const char* kind, const char* extension) {
      return folder_ / kind / (frame.name + extension);
    };
    const fs::path exact = file("disparity", ".pfm");
    const cv::Mat disparity = vision::read_disparity(fs::exists(exact) ? exact : file("disparity", ".png"));
    cv::Mat variance, search, reasons;
    if (const fs::path path = file("variance", ".pfm"); fs::exists(path)) variance = vision::read_pfm(path);
    if (const fs::path path = file("search", ".png"); fs::exists(path)) search = vision::read_grey_image(path);
    if (const fs::path path = file("reason", ".png"); fs::exists(path)) reasons = vision::read_grey_image(path);
    return panels_.layers({frame, {}, disparity, variance, search, reasons});
  }

  void add_paths(Json& data) const {
    const auto from_above = [](const std::vector<Eigen::Isometry3d>& poses) {
      Json path = Json::array();
      for (const Eigen::Isometry3d& pose : poses) {
        const Eigen::Vector3d position = (poses.front().inverse() * pose).translation();
        path.push_back({position.x(), position.z()});
      }
      return path;
    };
    std::vector<Eigen::Isometry3d> estimated;
    if (const fs::path file = folder_ / "poses.txt"; fs::exists(file)) {
      const std::vector<Eigen::Isometry3d> poses = vision::read_poses(file);
      for (const std::size_t row : in_run_) {
        if (row < poses.size()) estimated.push_back(poses[row]);
      }
    }
    data["path"] = from_above(estimated);
    data["true_path"] =
        arguments_.poses.empty() ? Json::array() : from_above(vision::poses_of_frames(sequence_, arguments_.poses));
  }

  std::vector<std::string> changed_options() const {
    std::vector<std::string> changed;
    for (const auto& [name, value] : list_options({})) {
      const auto used = run_["options"].find(name);
      if (used == run_["options"].end()) continue;
      if ((used->is_string() ? used->get<std::string>() : used->dump()) != value) changed.push_back(name);
    }
    return changed;
  }

  const ReportArguments& arguments_;
  const fs::path folder_;
  Json run_;
  vision::StereoSequence sequence_;
  std::vector<std::size_t> in_run_;  // place of each frame that is shown among all of the run
  FramePanels panels_;
  std::vector<std::string> notes_;
};

int report(const ReportArguments& arguments) {
  if (arguments.picture_width < 16 || arguments.picture_width > vision::kMaxImageSide) {
    throw InvalidArgument(
        fmt::format("--picture-width {}: choose from 16 to {}", arguments.picture_width, vision::kMaxImageSide));
  }
  const fs::path file = arguments.out.empty() ? fs::path(arguments.run) / "report.html" : fs::path(arguments.out);
  try {
    Page contents(arguments);
    expect_new_file("--out", file.string());
    const std::string page = contents.html();
    const vision::KeepFiles others;
    vision::write_file(file, page);
    fmt::print("{}: {:.1f} MB, opens in any browser\n", file.string(), static_cast<double>(page.size()) / 1e6);
  } catch (const Json::exception& error) {
    throw InvalidArgument(fmt::format("{}/report.json: not the report of a run: {}", arguments.run, error.what()));
  }
  return kOk;
}

}  // namespace

Command add_report(CLI::App& program) {
  CLI::App* command = program.add_subcommand("report", "Make one HTML page of a run: pictures, charts, path, options");
  auto arguments = std::make_shared<ReportArguments>();
  command->add_option("OUT", arguments->run, "the folder that `egosgm run` wrote")->type_name("")->required();
  command->add_option("TRUTH,--truth", arguments->truth, "true disparity: a file, a folder, or a data set's folder")
      ->type_name("FILE|DIR");
  command->add_option("--poses", arguments->poses, "true KITTI poses, drawn beside the estimated path")
      ->type_name("FILE");
  command
      ->add_option("--frames", arguments->frames,
                   "only these frame numbers, both ends included: 7:10, 7:, :10 or 7; without: all")
      ->type_name("FIRST:LAST");
  command
      ->add_option("--pictures", arguments->pictures,
                   "numbers of the frames to show, separated by commas; without: six, from the first to the last")
      ->type_name("LIST");
  command->add_option("--picture-width", arguments->picture_width, "wider pictures are scaled down to this [px]")
      ->type_name("N")
      ->capture_default_str();
  command
      ->add_option("--out", arguments->out,
                   "the page: a new file, or one that egosgm report made; without: OUT/report.html")
      ->type_name("FILE.html");
  command->footer(
      "The page holds everything that it shows: it needs no network and no other file. Variance and the width of the\n"
      "search are shown where the run wrote them: egosgm run --write variance,search");
  return {command, [arguments] { return report(*arguments); }};
}

}  // namespace egosgm::app
