// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/dataset.h"

#include <algorithm>
#include <cstdlib>
#include <set>
#include <system_error>
#include <utility>

#include "egosgm/error.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/image_io.h"
#include "vision/folder_contents.h"
#include "vision/foreign_file.h"
#include "vision/frame_names.h"
#include "vision/image_pairs.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;

using Kind = NamePattern::Kind;

fs::path if_there(const fs::path& file) { return is_file(file) ? file : fs::path(); }

/// The folder's own name, also for "." and "a/b/".
std::string name_of(const fs::path& folder) {
  std::error_code error;
  const fs::path absolute = fs::canonical(folder, error);
  return (error ? folder : absolute).filename().string();
}

void require_folder(const fs::path& folder, const std::string& remedy) {
  if (is_folder(folder)) return;
  if (const std::string kind = foreign_input(folder); !kind.empty()) {
    throw InvalidArgument(folder.string() + ": is no folder; " + kind);
  }
  std::error_code error;
  if (!fs::exists(folder, error)) {
    const bool is_link = fs::is_symlink(fs::symlink_status(folder, error));
    throw MissingPath(folder.string(), (is_link ? "is a link to what is not there; " : "no such folder; ") + remedy);
  }
  throw InvalidArgument(folder.string() + ": is no folder; " +
                        (is_image_name(folder) ? "give both pictures of a pair, LEFT RIGHT, or --left PATTERN --right "
                                                 "PATTERN --calib FILE, patterns in quotes, or " +
                                                     remedy
                                               : remedy));
}

/// The folders of left and right images, and whose calibration they need.
struct CameraFolders {
  std::string left, right;
  KittiCameras cameras;
};

const CameraFolders kGrey{"image_0", "image_1", KittiCameras::kGrey};
const CameraFolders kColor{"image_2", "image_3", KittiCameras::kColor};
const CameraFolders kRawGrey{"image_00/data", "image_01/data", KittiCameras::kGrey};
const CameraFolders kRawColor{"image_02/data", "image_03/data", KittiCameras::kColor};

CameraFolders find_cameras(const fs::path& folder, const CameraFolders& grey, const CameraFolders& color) {
  for (const CameraFolders& pair : {grey, color}) {
    if (is_folder(folder / pair.left) && is_folder(folder / pair.right)) return pair;
  }
  throw InvalidArgument(folder.string() + ": has neither " + grey.left + " and " + grey.right + " nor " + color.left +
                        " and " + color.right + "; " +
                        found_instead(folder).value_or("give the folder that holds them"));
}

/// Fills in the frames of two folders whose names are `prefix` and a number.
void add_frames(const fs::path& folder, const CameraFolders& cameras, const std::string& prefix, int digits,
                FrameRange range, StereoSequence& sequence) {
  const auto names_in = [&](const std::string& camera) {
    return NamePattern{folder / camera, prefix, "", Kind::kNumber, digits, true, {}};
  };
  const NamePattern left = names_in(cameras.left), right = names_in(cameras.right);
  const std::vector<NamedPair> pairs = pair_files(left, right, PairBy::kName);
  if (pairs.empty()) {
    throw InvalidArgument(folder.string() + ": holds no images; " +
                          found_instead(folder).value_or("give the folder or pattern of a stereo sequence"));
  }
  select_frames(pairs, left, range, folder.string(), sequence);
}

std::string nearest_scenes(const std::set<std::string>& scenes, const std::string& wanted) {
  constexpr std::size_t kMostNamed = 5;
  const auto distance = [&](const std::string& scene) {
    const auto a = parse_frame_number(scene), b = parse_frame_number(wanted);
    return a && b ? std::abs(static_cast<long>(*a) - static_cast<long>(*b)) : 0L;
  };
  std::vector<std::string> sorted(scenes.begin(), scenes.end());
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
  sorted.resize(std::min(sorted.size(), kMostNamed));
  std::string list;
  for (const std::string& scene : sorted) list += (list.empty() ? "" : ", ") + scene;
  return list.empty() ? "there is none" : "the nearest are " + list;
}

std::string scene_name(const std::string& scene) {
  constexpr std::size_t kDigits = 6;
  return is_digits(scene) && scene.size() < kDigits ? std::string(kDigits - scene.size(), '0') + scene : scene;
}

/// `folder` itself or its training or testing part, wherever the scene is.
fs::path find_multiview_folder(const fs::path& folder, const std::string& scene) {
  require_folder(folder, "give KITTI's `training` folder or its parent");
  std::set<std::string> scenes;
  bool has_images = false;
  for (const fs::path& candidate : {folder, folder / "training", folder / "testing"}) {
    for (const CameraFolders& pair : {kGrey, kColor}) {
      if (!is_folder(candidate / pair.left)) continue;
      has_images = true;
      const std::set<std::string> here = list_scenes(candidate / pair.left);
      if (here.contains(scene)) return candidate;
      scenes.insert(here.begin(), here.end());
    }
  }
  if (!has_images) {
    throw InvalidArgument(folder.string() + ": has no image_0 or image_2, nor has its `training`; " +
                          found_instead(folder).value_or("give KITTI's multi-view folder"));
  }
  throw InvalidArgument(folder.string() + ": has no scene '" + scene + "'; " + nearest_scenes(scenes, scene));
}

void add_multiview_truth(const fs::path& folder, const std::string& scene, StereoFrame& frame) {
  const std::string file = scene + "_" + padded(std::to_string(frame.number), 2) + ".png";
  for (const char* noc : {"disp_noc", "disp_noc_0"}) {
    if (frame.truth_noc.empty()) frame.truth_noc = if_there(folder / noc / file);
  }
  for (const char* occ : {"disp_occ", "disp_occ_0"}) {
    if (frame.truth_occ.empty()) frame.truth_occ = if_there(folder / occ / file);
  }
}

fs::path find_file(const std::vector<fs::path>& candidates, const std::string& remedy) {
  for (const fs::path& candidate : candidates) {
    if (is_file(candidate)) return candidate;
    std::error_code none;
    if (fs::exists(candidate, none)) throw InvalidArgument(candidate.string() + ": is no file; " + remedy);
  }
  throw MissingPath(candidates.front().string(), "no such calibration file; " + remedy);
}

/// KITTI's name for the folder of a colour camera chooses the colour pair of a calibration that holds both.
KittiCameras cameras_of(const fs::path& folder) {
  for (const fs::path& part : folder) {
    if (part == "image_2" || part == "image_02") return KittiCameras::kColor;
  }
  return KittiCameras::kAny;
}

/// Reads a file with both of KITTI's pairs of cameras: images in colour are of the second one, whatever their folder is
/// called.
SizedCalibration calibration_of(const fs::path& file, const fs::path& folder, const std::vector<StereoFrame>& frames) {
  const KittiCameras cameras = cameras_of(folder);
  if (cameras == KittiCameras::kAny && first_readable_image(frames).type.channels == 3) {
    try {
      return read_sized_calibration(file, KittiCameras::kColor);
    } catch (const InvalidArgument&) {  // it has one pair alone, or is told below
    }
  }
  return read_sized_calibration(file, cameras);
}

void calibrate(const SizedCalibration& found, StereoSequence& sequence) {
  sequence.calibration = found.calibration;
  sequence.calibrated_width = found.width;
  sequence.calibrated_height = found.height;
}

/// times.txt or timestamps.txt in one of the folders.
fs::path find_times(const std::vector<fs::path>& folders) {
  for (const fs::path& folder : folders) {
    for (const char* name : {"times.txt", "timestamps.txt"}) {
      if (is_file(folder / name)) return folder / name;
    }
  }
  return {};
}

/// Whether `file` lies in the folder above `folder`.
bool is_parent(const fs::path& file, const fs::path& folder) {
  std::error_code error;
  return fs::equivalent(file.has_parent_path() ? file.parent_path() : fs::path("."), folder / "..", error) && !error;
}

/// `folder / stem` with an image's extension.
fs::path image_named(const fs::path& folder, const std::string& stem) {
  for (const std::string& name : list_folder(folder)) {
    if (is_image_name(name) && fs::path(name).stem() == stem) return folder / name;
  }
  return folder / (stem + ".png");
}

}  // namespace

FrameRange parse_frame_range(const std::string& text) {
  const auto refuse = [&]() -> FrameRange {
    throw InvalidArgument("frames '" + text +
                          "': give FIRST:LAST with FIRST at most LAST, FIRST:, :LAST or one number, for example 7:10");
  };
  const std::size_t colon = text.find(':');
  FrameRange range;
  const std::string first = text.substr(0, colon);
  const std::string last = colon == std::string::npos ? first : text.substr(colon + 1);
  if (!first.empty() && !(range.first = parse_frame_number(first))) return refuse();
  if (!last.empty() && !(range.last = parse_frame_number(last))) return refuse();
  if (!range.first && !range.last) return refuse();
  if (range.first && range.last && *range.first > *range.last) return refuse();
  return range;
}

StereoSequence open_kitti_multiview(const fs::path& folder, const std::string& scene, FrameRange range) {
  const std::string name = scene_name(scene);
  const fs::path root = find_multiview_folder(folder, name);
  const CameraFolders cameras = find_cameras(root, kGrey, kColor);
  StereoSequence sequence;
  sequence.title = std::string(cameras.cameras == KittiCameras::kGrey ? "KITTI 2012" : "KITTI 2015") + " scene " + name;
  add_frames(root, cameras, name + "_", 2, range, sequence);
  for (StereoFrame& frame : sequence.frames) add_multiview_truth(root, name, frame);
  sequence.calibration_file = find_file({root / "calib" / (name + ".txt"), root / "calib_cam_to_cam" / (name + ".txt")},
                                        "get the data set's calibration files");
  calibrate(read_sized_calibration(sequence.calibration_file, cameras.cameras), sequence);
  return sequence;
}

StereoSequence open_kitti_odometry(const fs::path& folder, FrameRange range) {
  require_folder(folder, "give a KITTI odometry sequence, for example sequences/00");
  const CameraFolders cameras = find_cameras(folder, kGrey, kColor);
  StereoSequence sequence;
  sequence.title = "KITTI odometry " + name_of(folder);
  add_frames(folder, cameras, "", 6, range, sequence);
  for (StereoFrame& frame : sequence.frames) {
    frame.truth_noc = if_there(folder / "truth/left_disp_noc" / (frame.name + ".png"));
    frame.truth_occ = if_there(folder / "truth/left_disp_occ" / (frame.name + ".png"));
  }
  sequence.calibration_file = find_file({folder / "calib.txt"}, "get the sequence's calibration");
  calibrate(read_sized_calibration(sequence.calibration_file, cameras.cameras), sequence);
  sequence.times_file = find_times({folder});
  sequence.poses_file = if_there(folder / "poses.txt");
  if (sequence.poses_file.empty()) {
    std::error_code error;
    const fs::path absolute = fs::canonical(folder, error);
    if (!error) {
      sequence.poses_file =
          if_there(absolute.parent_path().parent_path() / "poses" / (absolute.filename().string() + ".txt"));
    }
  }
  return sequence;
}

StereoSequence open_kitti_raw(const fs::path& folder, FrameRange range) {
  require_folder(folder, "give a KITTI raw drive, for example 2011_09_26_drive_0001_sync");
  const CameraFolders cameras = find_cameras(folder, kRawGrey, kRawColor);
  StereoSequence sequence;
  sequence.title = "KITTI raw " + name_of(folder);
  add_frames(folder, cameras, "", 10, range, sequence);
  sequence.calibration_file = find_file({folder / "calib_cam_to_cam.txt", folder / ".." / "calib_cam_to_cam.txt"},
                                        "put the day's calib_cam_to_cam.txt into the drive's folder or its parent");
  calibrate(read_sized_calibration(sequence.calibration_file, cameras.cameras), sequence);
  sequence.times_file = find_times({(folder / cameras.left).parent_path()});
  return sequence;
}

StereoSequence open_middlebury(const fs::path& folder, FrameRange range) {
  require_folder(folder, "give a Middlebury scene's folder");
  StereoSequence sequence = open_patterns(image_named(folder, "im0").string(), image_named(folder, "im1").string(),
                                          folder / "calib.txt", range);
  sequence.title = "Middlebury " + name_of(folder);
  sequence.frames[0].truth_occ = if_there(folder / "disp0GT.pfm");
  if (sequence.frames[0].truth_occ.empty()) sequence.frames[0].truth_occ = if_there(folder / "disp0.pfm");
  return sequence;
}

StereoSequence open_patterns(const std::string& left, const std::string& right, const fs::path& calibration_file,
                             FrameRange range, PairBy pair_by) {
  const NamePattern left_pattern = parse_pattern(left), right_pattern = parse_pattern(right);
  const std::vector<NamedPair> pairs = pairs_of_patterns(left_pattern, right_pattern, left, right, pair_by);
  if (pairs.empty()) {
    throw InvalidArgument(left +
                          ": holds no images that are PNG or JPEG; give the folder or pattern of a stereo sequence, or "
                          "have `egosgm rectify` make one of other files");
  }
  StereoSequence sequence;
  sequence.title = left + " and " + right;
  select_frames(pairs, left_pattern, range, left, sequence);
  if (pair_by == PairBy::kOrder) {
    const std::string note = order_note(pairs);
    sequence.note += (sequence.note.empty() || note.empty() ? "" : "; ") + note;
  }
  sequence.calibration_file = calibration_file;
  sequence.has_calibration = !calibration_file.empty();
  if (sequence.has_calibration) {
    calibrate(calibration_of(calibration_file, left_pattern.folder, sequence.frames), sequence);
  } else {
    const Image image = first_readable_image(sequence.frames);
    const Size size = image.empty() ? read_image_size(sequence.frames.front().left) : image.size();
    sequence.calibration = {.fx = static_cast<double>(size.width),
                            .fy = static_cast<double>(size.width),
                            .cx = size.width / 2.0,
                            .cy = size.height / 2.0,
                            .baseline_m = 1};
  }
  std::vector<fs::path> own{left_pattern.folder};
  if (sequence.has_calibration && is_parent(calibration_file, left_pattern.folder))
    own.push_back(left_pattern.folder / "..");
  sequence.times_file = find_times(own);
  return sequence;
}

StereoSequence open_folder(const fs::path& folder, FrameRange range) {
  require_folder(folder, "give the folder of a stereo sequence");
  if (is_folder(folder / kRawGrey.left) || is_folder(folder / kRawColor.left)) return open_kitti_raw(folder, range);
  if (is_folder(folder / kGrey.left) || is_folder(folder / kColor.left)) return open_kitti_odometry(folder, range);
  if (is_file(image_named(folder, "im0"))) return open_middlebury(folder, range);
  if (const auto cameras = find_two_cameras(folder); cameras && foreign_calibration(folder, *cameras).empty()) {
    StereoSequence sequence = open_patterns(cameras->left, cameras->right, cameras->calibration, range);
    sequence.title = name_of(folder);
    sequence.poses_file = if_there(folder / "poses.txt");
    return sequence;
  }
  throw InvalidArgument(
      folder.string() + ": is no stereo sequence; " +
      found_instead(folder).value_or("give a folder with image_0 and image_1, image_00/data and image_01/data, "
                                     "im0.png and im1.png, left and right, or a folder with left.png and right.png for "
                                     "each pair"));
}

}  // namespace egosgm::vision
