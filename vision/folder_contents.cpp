// SPDX-License-Identifier: Apache-2.0
#include "vision/folder_contents.h"

#include <algorithm>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "egosgm/error.h"
#include "vision/file_io.h"
#include "vision/file_kinds.h"
#include "vision/foreign_file.h"
#include "vision/frame_names.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;
using Contents = std::optional<std::string>;

constexpr std::pair<const char*, const char*> kSides[] = {{"left", "right"}, {"Left", "Right"}, {"LEFT", "RIGHT"},
                                                          {"_L", "_R"},      {"_l", "_r"},      {"infra1", "infra2"},
                                                          {"lcam", "rcam"}};
constexpr std::size_t kMostNamed = 5;
constexpr std::size_t kMostFolders = 1000;  // a data set has no more beside each other; looking stays short

/// Names in a folder, sorted; none where it cannot be listed.
std::vector<std::string> names_in(const fs::path& folder) {
  try {
    return list_folder(folder);
  } catch (const InvalidArgument&) {
    return {};
  }
}

std::vector<fs::path> folders_in(const fs::path& folder) {
  std::vector<fs::path> folders;
  for (const std::string& name : names_in(folder)) {
    if (folders.size() == kMostFolders) break;
    if (!name.starts_with('.') && is_folder(folder / name)) folders.push_back(folder / name);
  }
  return folders;
}

bool holds_both(const fs::path& folder, const std::string& left, const std::string& right) {
  return is_folder(folder / left) && is_folder(folder / right);
}

bool holds_images(const fs::path& folder) {
  if (folder.filename().string().find("disp") != std::string::npos) return false;  // but disparity maps
  const std::vector<std::string> names = names_in(folder);
  return std::any_of(names.begin(), names.end(), [](const std::string& name) { return is_image_name(name); });
}

std::set<std::string> scenes_in(const fs::path& folder) {
  std::set<std::string> scenes;
  for (const char* camera : {"image_0", "image_2"}) {
    if (is_folder(folder / camera)) scenes.merge(list_scenes(folder / camera));
  }
  return scenes;
}

/// The pattern of a camera's images: `*`, or what they have beside their number, which begins or ends with the camera's
/// name.
std::string pattern_in(const fs::path& folder, const std::string& side) {
  for (const std::string& name : names_in(folder)) {
    const std::string stem = fs::path(name).stem().string();
    if (!is_image_name(name)) continue;
    if (stem.starts_with(side + "_")) return (folder / (side + "_*")).string();
    if (stem.ends_with("_" + side)) return (folder / ("*_" + side)).string();
    break;
  }
  return (folder / "*").string();
}

bool is_sequence(const fs::path& folder) {
  if (holds_both(folder, "image_00/data", "image_01/data") || holds_both(folder, "image_02/data", "image_03/data"))
    return true;
  if (holds_both(folder, "image_0", "image_1") || holds_both(folder, "image_2", "image_3"))
    return scenes_in(folder).empty();
  for (const char* image : {"im0.png", "im0.jpg", "im0.jpeg"}) {
    if (is_file(folder / image)) return true;
  }
  return find_two_cameras(folder).has_value();
}

Contents multiview(const fs::path& folder) {
  for (const fs::path& candidate : {folder, folder / "training", folder / "testing"}) {
    const std::set<std::string> scenes = scenes_in(candidate);
    if (scenes.empty()) continue;
    return "it holds KITTI's multi-view scenes " + *scenes.begin() +
           (scenes.size() > 1 ? ".." + *scenes.rbegin() : "") + ": use --kitti '" + candidate.string() + "' --scene " +
           *scenes.begin();
  }
  return std::nullopt;
}

Contents sequences_below(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const fs::path& child : folders_in(folder)) {
    if (is_sequence(child)) found.push_back(child);
  }
  if (found.empty()) {
    for (const fs::path& child : folders_in(folder)) {
      for (const fs::path& grandchild : folders_in(child)) {
        if (is_sequence(grandchild)) found.push_back(grandchild);
      }
    }
  }
  if (found.empty()) return std::nullopt;
  std::string names;
  for (std::size_t i = 0; i < std::min(found.size(), kMostNamed); ++i) {
    names += (i > 0 ? ", " : "") + found[i].lexically_relative(folder).string();
  }
  if (found.size() > kMostNamed) names += " and " + std::to_string(found.size() - kMostNamed) + " more";
  return "it holds " + names + ": give " + (found.size() > 1 ? "one of them, for example " : "") +
         found.front().string();
}

/// The name of an image with `*` in place of its last number.
std::string without_number(const std::string& name) {
  const std::size_t last = name.find_last_of("0123456789", name.find_last_of('.'));
  if (last == std::string::npos) return name;
  const std::size_t before = name.find_last_not_of("0123456789", last);
  const std::size_t first = before == std::string::npos ? 0 : before + 1;
  return std::string(name).replace(first, last - first + 1, "*");
}

/// The left and the right images of the pairs in a folder, by their names.
std::vector<std::pair<std::string, std::string>> pairs_in(const fs::path& folder) {
  std::vector<std::pair<std::string, std::string>> pairs;
  for (const std::string& name : names_in(folder)) {
    if (!is_image_name(name)) continue;
    for (const auto& [left, right] : kSides) {
      const std::size_t at = name.find(left);
      if (at == std::string::npos) continue;
      const std::string partner = std::string(name).replace(at, std::strlen(left), right);
      if (is_file(folder / partner)) pairs.emplace_back(name, partner);
    }
  }
  return pairs;
}

/// Images of both cameras in one folder.
Contents both_cameras(const fs::path& folder) {
  const std::vector<std::pair<std::string, std::string>> pairs = pairs_in(folder);
  if (pairs.empty()) return std::nullopt;
  return "it holds images of both cameras: give --left '" + (folder / without_number(pairs[0].first)).string() +
         "' --right '" + (folder / without_number(pairs[0].second)).string() + "' --calib FILE";
}

/// Folders that may be the cameras', of names that do not say so.
Contents folders_of_images(const fs::path& folder) {
  std::vector<fs::path> found;
  for (const fs::path& child : folders_in(folder)) {
    std::vector<fs::path> places{child};
    if (!holds_images(child)) places = folders_in(child);
    for (const fs::path& place : places) {
      if (holds_images(place)) found.push_back(place);
    }
  }
  if (found.size() < 2) return std::nullopt;
  const auto name_of = [&](const fs::path& place) { return place.lexically_relative(folder).string(); };
  return "its folders " + name_of(found[0]) + " and " + name_of(found[1]) +
         (found.size() > 2 ? " and " + std::to_string(found.size() - 2) + " more" : "") +
         " hold images: where two of them are the left and the right camera's, give --left '" +
         (found[0] / "*").string() + "' --right '" + (found[1] / "*").string() + "' --calib FILE, with their names";
}

/// The folder of one camera's images.
Contents one_camera(const fs::path& folder) {
  if (holds_both(folder, "left", "right") || holds_both(folder, "cam0", "cam1")) return std::nullopt;
  std::error_code error;
  const fs::path absolute = fs::canonical(folder, error);
  for (const fs::path& above : {absolute.parent_path(), absolute.parent_path().parent_path()}) {
    if (!error && is_sequence(above)) return "it belongs to the sequence " + above.string() + ": give that one";
  }
  if (!holds_images(folder)) return std::nullopt;
  return "it holds images of its own: give --left '" + (folder / "LEFT_*").string() + "' --right '" +
         (folder / "RIGHT_*").string() +
         "' --calib FILE, with the names that they have; where each shows both views side by side, `egosgm rectify "
         "--side-by-side '" +
         (folder / "*").string() + "'` parts them; --top-bottom, where one view lies above the other";
}

Contents two_cameras(const fs::path& folder) {
  const std::optional<TwoCameras> cameras = find_two_cameras(folder);
  if (!cameras) return std::nullopt;
  return "it holds two cameras and no calib.txt: put their calibration there, or give '" + folder.string() +
         "' --calib '" + foreign_calibration(folder, *cameras).string() + "'";
}

Contents euroc(const fs::path& folder) {
  for (const fs::path& candidate : {folder, folder / "mav0"}) {
    if (is_file(candidate / "cam0/data.csv"))
      return "it is an EuRoC recording: egosgm rectify --euroc '" + folder.string() + "' makes a sequence of it";
  }
  return std::nullopt;
}

Contents recording(const fs::path& folder) { return is_bag(folder) ? Contents(kRecording) : std::nullopt; }

Contents videos(const fs::path& folder) {
  for (const char* type : {".mp4", ".avi", ".mkv", ".mov"}) {
    const fs::path left = folder / ("left" + std::string(type)), right = folder / ("right" + std::string(type));
    if (is_file(left) && is_file(right))
      return "it holds two videos: give '" + left.string() + "' '" + right.string() + "' --calib FILE";
  }
  const std::vector<std::string> names = names_in(folder);
  if (names.size() > kMostFolders) return std::nullopt;
  std::vector<fs::path> found;
  for (const std::string& name : names) {
    if (is_video(folder / name)) found.push_back(folder / name);
  }
  if (found.size() != 1) return std::nullopt;
  return "it holds a video: give '" + found.front().string() + "' --calib FILE";
}

/// Names of the folders of both cameras: the usual ones, then any with left or right in it that holds
/// images.
std::vector<std::pair<std::string, std::string>> names_of_cameras(const fs::path& folder) {
  std::vector<std::pair<std::string, std::string>> names{
      {"left", "right"}, {"cam0", "cam1"}, {"image_left", "image_right"}, {"L", "R"}, {"l", "r"}};
  for (const fs::path& child : folders_in(folder)) {
    const std::string name = child.filename().string();
    for (const auto& [left, right] : kSides) {
      const std::size_t at = name.find(left);
      if (at == std::string::npos) continue;
      const std::string partner = std::string(name).replace(at, std::strlen(left), right);
      if (is_folder(folder / partner) && holds_images(child)) names.emplace_back(name, partner);
    }
  }
  return names;
}

/// Folders of both cameras without an image that is read.
Contents cameras_without_images(const fs::path& folder) {
  for (const auto& [left, right] : names_of_cameras(folder)) {
    if (!holds_both(folder, left, right)) continue;
    const std::string text = "its folders " + left + " and " + right + " hold no images that are PNG or JPEG";
    const std::vector<std::string> names = names_in(folder / left);
    if (names.empty()) return text + ": " + left + " is empty";
    const fs::path first = folder / left / names.front();
    const std::string kind = is_file(first) ? foreign_kind(read_file_start(first, kKindBytes), first) : "";
    return text + ", but " + left + "/" + names.front() +
           (kind.empty() ? ": `egosgm rectify` makes a sequence of images of other kinds" : ": " + kind);
  }
  return names_in(folder).empty() ? Contents("it is empty") : std::nullopt;
}

/// The left and the right image of a pair, by their names; nothing where there are none, or several.
std::optional<std::pair<std::string, std::string>> pair_in(const fs::path& folder) {
  const std::vector<std::pair<std::string, std::string>> pairs = pairs_in(folder);
  return pairs.size() == 1 ? std::optional(pairs.front()) : std::nullopt;
}

/// Pairs that have a folder each, or those that `folder` holds, whose names differ by a number alone.
std::optional<TwoCameras> find_pairs_in(const fs::path& folder) {
  const std::vector<std::pair<std::string, std::string>> pairs = pairs_in(folder);
  const auto pattern_of = [](const auto& pair) {
    return std::pair(without_number(pair.first), without_number(pair.second));
  };
  if (!pairs.empty() && std::all_of(pairs.begin(), pairs.end(),
                                    [&](const auto& pair) { return pattern_of(pair) == pattern_of(pairs[0]); })) {
    const auto [left, right] = pattern_of(pairs[0]);
    return TwoCameras{folder / left, folder / right, {}};
  }
  for (const fs::path& child : folders_in(folder)) {
    if (const auto pair = pair_in(child))
      return TwoCameras{folder / "*" / pair->first, folder / "*" / pair->second, {}};
    if (!names_in(child).empty()) break;  // those of one sequence are alike
  }
  return std::nullopt;
}

Contents result_of_a_run(const fs::path& folder) {
  if (!is_file(folder / "report.json")) return std::nullopt;
  return "it is what `egosgm run` wrote: give the run's input";
}

}  // namespace

Contents found_instead(const fs::path& folder) {
  for (const auto& look : {multiview, sequences_below, euroc, recording, videos, result_of_a_run, two_cameras,
                           both_cameras, one_camera, folders_of_images, cameras_without_images}) {
    if (Contents found = look(folder)) return found;
  }
  return std::nullopt;
}

std::optional<TwoCameras> find_two_cameras(const fs::path& folder) {
  if (result_of_a_run(folder)) return std::nullopt;  // whose right maps are no images
  std::optional<TwoCameras> cameras;
  for (const auto& [left, right] : names_of_cameras(folder)) {
    if (!holds_both(folder, left, right)) continue;
    if (!holds_images(folder / left)) return std::nullopt;
    cameras = {pattern_in(folder / left, "left"), pattern_in(folder / right, "right"), {}};
    break;
  }
  if (!cameras) cameras = find_pairs_in(folder);
  for (const std::string& name : cameras ? names_in(folder) : std::vector<std::string>()) {
    const std::string known = lower(name);
    const bool is_calibration = (known == "calib.txt" || known == "calibration.txt") && is_file(folder / name);
    if (is_calibration && cameras->calibration.empty()) cameras->calibration = folder / name;
  }
  return cameras;
}

fs::path foreign_calibration(const fs::path& folder, const TwoCameras& cameras) {
  std::vector<fs::path> files;
  for (const std::string& name : names_in(folder)) {
    const std::string type = fs::path(name).extension().string();
    if (type == ".json" || type == ".yaml" || type == ".yml" || type == ".xml" || type == ".npz" || type == ".conf") {
      files.push_back(folder / name);
    }
  }
  // Of a file for each camera the left one will do: its reader finds the other one.
  const bool is_pair =
      files.size() == 2 && std::any_of(std::begin(kSides), std::end(kSides), [&](const auto& side) {
        const std::string name = files[0].filename().string();
        const std::size_t at = name.find(side.first);
        return at != std::string::npos &&
               std::string(name).replace(at, std::strlen(side.first), side.second) == files[1].filename();
      });
  return cameras.calibration.empty() && (files.size() == 1 || is_pair) ? files.front() : fs::path();
}

std::set<std::string> list_scenes(const fs::path& images) {
  std::set<std::string> scenes;
  for (const std::string& name : list_folder(images)) {
    const std::size_t end = name.find('_');
    if (end != std::string::npos && is_image_name(name) && is_digits(name.substr(0, end))) {
      scenes.insert(name.substr(0, end));
    }
  }
  return scenes;
}

}  // namespace egosgm::vision
