// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/dataset.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <map>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "egosgm/error.h"
#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/poses_io.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;

bool is_digits(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::optional<int> parse_frame_number(std::string_view text) {
  int number = 0;
  if (!is_digits(text)) return std::nullopt;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  return number;
}

std::string padded(int number, int width) {
  std::string digits = std::to_string(number);
  if (digits.size() < static_cast<std::size_t>(width))
    digits.insert(0, static_cast<std::size_t>(width) - digits.size(), '0');
  return digits;
}

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

fs::path if_there(const fs::path& file) { return is_file(file) ? file : fs::path(); }

/// The folder's own name, also for "." and "a/b/".
std::string name_of(const fs::path& folder) {
  std::error_code error;
  const fs::path absolute = fs::canonical(folder, error);
  return (error ? folder : absolute).filename().string();
}

void require_folder(const fs::path& folder, const std::string& remedy) {
  if (!is_folder(folder)) throw InvalidArgument(folder.string() + ": no such folder; " + remedy);
}

/// Names in a folder, sorted.
std::vector<std::string> list_folder(const fs::path& folder) {
  std::error_code error;
  std::vector<std::string> names;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    names.push_back(entry->path().filename().string());
  }
  if (error)
    throw InvalidArgument(folder.string() + ": cannot be listed: " + error.message() + "; give a readable folder");
  std::sort(names.begin(), names.end());
  return names;
}

/// Names that are a prefix, a frame number and a suffix.
struct FramePattern {
  fs::path folder;
  std::string prefix, suffix;
  int digits = 6;  // least number of them

  fs::path file_of(int number) const { return folder / (prefix + padded(number, digits) + suffix); }

  std::set<int> numbers() const {
    std::set<int> found;
    for (const std::string& name : list_folder(folder)) {
      if (name.size() <= prefix.size() + suffix.size() || !name.starts_with(prefix) || !name.ends_with(suffix))
        continue;
      const std::string_view middle(name.data() + prefix.size(), name.size() - prefix.size() - suffix.size());
      const std::optional<int> number = parse_frame_number(middle);
      if (number && middle == padded(*number, digits)) found.insert(*number);
    }
    return found;
  }
};

std::string describe(const std::set<int>& numbers) {
  return std::to_string(*numbers.begin()) + ".." + std::to_string(*numbers.rbegin());
}

/// The wanted range among the frames that are there, or an error that names the first file that is missing.
template <typename LeftOf, typename RightOf>
std::vector<StereoFrame> select_frames(const std::set<int>& left, const std::set<int>& right, FrameRange range,
                                       const std::string& what, LeftOf left_of, RightOf right_of) {
  std::set<int> all = left;
  all.insert(right.begin(), right.end());
  if (all.empty()) throw InvalidArgument(what + ": holds no images; give the folder or pattern of a stereo sequence");
  const int first = range.first.value_or(*all.begin());
  const int last = range.last.value_or(*all.rbegin());
  const std::string remedy = "; there are frames " + describe(all) + ", select whole ones with --frames FIRST:LAST";
  if (first > last) {
    throw InvalidArgument(what + ": holds no frame in " + (range.first ? std::to_string(first) : "") + ":" +
                          (range.last ? std::to_string(last) : "") + remedy);
  }
  std::vector<StereoFrame> frames;
  for (int number = first;; ++number) {
    const bool has_left = left.contains(number), has_right = right.contains(number);
    if (!has_left && !has_right) {
      throw InvalidArgument(left_of(number).string() + ": frame " + std::to_string(number) + " is missing" + remedy);
    }
    if (!has_left) {
      throw InvalidArgument(left_of(number).string() + ": left image of " + right_of(number).string() + " is missing" +
                            remedy);
    }
    if (!has_right) {
      throw InvalidArgument(right_of(number).string() + ": right image of " + left_of(number).string() + " is missing" +
                            remedy);
    }
    StereoFrame frame;
    frame.number = number;
    frame.name = padded(number, 6);
    frame.left = left_of(number);
    frame.right = right_of(number);
    frames.push_back(std::move(frame));
    if (number == last) return frames;
  }
}

std::vector<StereoFrame> select_frames(const FramePattern& left, const FramePattern& right, FrameRange range,
                                       const std::string& what) {
  return select_frames(
      left.numbers(), right.numbers(), range, what, [&](int number) { return left.file_of(number); },
      [&](int number) { return right.file_of(number); });
}

/// The folders of left and right images, and whose calibration they need.
struct CameraFolders {
  std::string left, right;
  KittiCameras cameras;
};

CameraFolders find_cameras(const fs::path& folder, const CameraFolders& grey, const CameraFolders& color) {
  for (const CameraFolders& pair : {grey, color}) {
    if (is_folder(folder / pair.left) && is_folder(folder / pair.right)) return pair;
  }
  throw InvalidArgument(folder.string() + ": has neither " + grey.left + " and " + grey.right + " nor " + color.left +
                        " and " + color.right + "; give the folder that holds them");
}

const CameraFolders kGrey{"image_0", "image_1", KittiCameras::kGrey};
const CameraFolders kColor{"image_2", "image_3", KittiCameras::kColor};
const CameraFolders kRawGrey{"image_00/data", "image_01/data", KittiCameras::kGrey};
const CameraFolders kRawColor{"image_02/data", "image_03/data", KittiCameras::kColor};

/// Scenes of a multi-view folder: NNNNNN of NNNNNN_FF.png.
std::set<std::string> list_scenes(const fs::path& images) {
  std::set<std::string> scenes;
  for (const std::string& name : list_folder(images)) {
    const std::size_t end = name.find('_');
    if (end != std::string::npos && name.ends_with(".png") && is_digits(name.substr(0, end))) {
      scenes.insert(name.substr(0, end));
    }
  }
  return scenes;
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
    throw InvalidArgument(folder.string() +
                          ": has no image_0 or image_2, nor has its `training`; give KITTI's multi-view folder");
  }
  throw InvalidArgument(folder.string() + ": has no scene '" + scene + "'; " + nearest_scenes(scenes, scene));
}

void add_multiview_truth(const fs::path& folder, const std::string& scene, StereoFrame& frame) {
  const std::string file = scene + "_" + padded(frame.number, 2) + ".png";
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
  }
  throw InvalidArgument(candidates.front().string() + ": no such calibration file; " + remedy);
}

/// A pattern's file name around its one `%0Nd` or `*`.
struct NameParts {
  fs::path folder;
  std::string prefix, suffix;
  char kind = 0;   // 'd', '*', or 0 for a plain name
  int digits = 1;  // of %0Nd
};

NameParts parse_pattern(const std::string& pattern) {
  const fs::path path(pattern);
  const std::string name = path.filename().string();
  const auto refuse = [&]() -> NameParts {
    throw InvalidArgument("pattern '" + pattern +
                          "': its file name must hold one %d, %06d (or the like) or one *, and its folder none");
  };
  NameParts parts;
  parts.folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (name.empty() || parts.folder.string().find_first_of("*%") != std::string::npos) return refuse();
  const std::size_t begin = name.find_first_of("*%");
  if (begin == std::string::npos) {
    parts.prefix = name;
    return parts;
  }
  std::size_t end = begin + 1;
  parts.kind = '*';
  if (name[begin] == '%') {
    const std::size_t width = end;
    while (end < name.size() && name[end] >= '0' && name[end] <= '9') ++end;
    if (end == name.size() || name[end] != 'd' || end - width > 3) return refuse();
    parts.kind = 'd';
    if (end > width) {
      const int digits = std::atoi(name.substr(width, end - width).c_str());
      if (name[width] != '0' || digits < 1 || digits > 20) return refuse();
      parts.digits = digits;
    }
    ++end;
  }
  parts.prefix = name.substr(0, begin);
  parts.suffix = name.substr(end);
  if (parts.suffix.find_first_of("*%") != std::string::npos) return refuse();
  return parts;
}

/// KITTI's name for the folder of a colour camera chooses the colour pair of a calibration that holds both.
KittiCameras cameras_of(const fs::path& folder) {
  for (const fs::path& part : folder) {
    if (part == "image_2" || part == "image_02") return KittiCameras::kColor;
  }
  return KittiCameras::kAny;
}

/// What `*` stands for -> file.
std::map<std::string, fs::path> match_glob(const NameParts& parts) {
  std::map<std::string, fs::path> files;
  for (const std::string& name : list_folder(parts.folder)) {
    if (name.size() < parts.prefix.size() + parts.suffix.size()) continue;
    if (!name.starts_with(parts.prefix) || !name.ends_with(parts.suffix)) continue;
    files[name.substr(parts.prefix.size(), name.size() - parts.prefix.size() - parts.suffix.size())] =
        parts.folder / name;
  }
  return files;
}

/// Frame numbers of what `*` stands for: the texts themselves, if they are different numbers, else their order.
std::map<std::string, int> number_texts(const std::set<std::string>& texts) {
  std::map<std::string, int> numbers;
  std::set<int> used;
  for (const std::string& text : texts) {
    const std::optional<int> number = parse_frame_number(text);
    if (!number || !used.insert(*number).second) {
      numbers.clear();
      break;
    }
    numbers[text] = *number;
  }
  if (numbers.empty()) {
    int position = 0;
    for (const std::string& text : texts) numbers[text] = position++;
  }
  return numbers;
}

std::vector<StereoFrame> open_globs(const NameParts& left, const NameParts& right, FrameRange range,
                                    const std::string& what) {
  const std::map<std::string, fs::path> left_files = match_glob(left), right_files = match_glob(right);
  std::set<std::string> texts;
  for (const auto& [text, file] : left_files) texts.insert(text);
  for (const auto& [text, file] : right_files) texts.insert(text);
  std::set<int> left_numbers, right_numbers;
  std::map<int, std::string> text_of;
  for (const auto& [text, number] : number_texts(texts)) {
    text_of[number] = text;
    if (left_files.contains(text)) left_numbers.insert(number);
    if (right_files.contains(text)) right_numbers.insert(number);
  }
  const auto file_of = [&](const NameParts& parts) {
    return [&](int number) {
      const auto text = text_of.find(number);
      return parts.folder /
             (parts.prefix + (text == text_of.end() ? std::to_string(number) : text->second) + parts.suffix);
    };
  };
  return select_frames(left_numbers, right_numbers, range, what, file_of(left), file_of(right));
}

std::vector<StereoFrame> open_pair(const NameParts& left, const NameParts& right, FrameRange range,
                                   const std::string& what) {
  const fs::path left_file = left.folder / left.prefix, right_file = right.folder / right.prefix;
  for (const fs::path& file : {left_file, right_file}) {
    if (!is_file(file)) throw InvalidArgument(file.string() + ": no such image; give an existing PNG file");
  }
  return select_frames(
      {0}, {0}, range, what, [&](int) { return fs::path(left_file); }, [&](int) { return fs::path(right_file); });
}

}  // namespace

FrameRange parse_frame_range(const std::string& text) {
  const auto refuse = [&]() -> FrameRange {
    throw InvalidArgument("frames '" + text + "': give FIRST:LAST, FIRST:, :LAST or one number, for example 7:10");
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
  sequence.frames = select_frames({root / cameras.left, name + "_", ".png", 2},
                                  {root / cameras.right, name + "_", ".png", 2}, range, root.string());
  for (StereoFrame& frame : sequence.frames) add_multiview_truth(root, name, frame);
  sequence.calibration_file = find_file({root / "calib" / (name + ".txt"), root / "calib_cam_to_cam" / (name + ".txt")},
                                        "get the data set's calibration files");
  sequence.calibration = read_calibration(sequence.calibration_file, cameras.cameras);
  return sequence;
}

StereoSequence open_kitti_odometry(const fs::path& folder, FrameRange range) {
  require_folder(folder, "give a KITTI odometry sequence, for example sequences/00");
  const CameraFolders cameras = find_cameras(folder, kGrey, kColor);
  StereoSequence sequence;
  sequence.title = "KITTI odometry " + name_of(folder);
  sequence.frames = select_frames({folder / cameras.left, "", ".png", 6}, {folder / cameras.right, "", ".png", 6},
                                  range, folder.string());
  for (StereoFrame& frame : sequence.frames) {
    frame.truth_noc = if_there(folder / "truth/left_disp_noc" / (frame.name + ".png"));
    frame.truth_occ = if_there(folder / "truth/left_disp_occ" / (frame.name + ".png"));
  }
  sequence.calibration_file = find_file({folder / "calib.txt"}, "get the sequence's calibration");
  sequence.calibration = read_calibration(sequence.calibration_file, cameras.cameras);
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
  sequence.frames = select_frames({folder / cameras.left, "", ".png", 10}, {folder / cameras.right, "", ".png", 10},
                                  range, folder.string());
  sequence.calibration_file = find_file({folder / "calib_cam_to_cam.txt", folder / ".." / "calib_cam_to_cam.txt"},
                                        "put the day's calib_cam_to_cam.txt into the drive's folder or its parent");
  sequence.calibration = read_calibration(sequence.calibration_file, cameras.cameras);
  return sequence;
}

StereoSequence open_middlebury(const fs::path& folder) {
  require_folder(folder, "give a Middlebury scene's folder");
  StereoSequence sequence =
      open_patterns((folder / "im0.png").string(), (folder / "im1.png").string(), folder / "calib.txt");
  sequence.title = "Middlebury " + name_of(folder);
  sequence.frames[0].truth_occ = if_there(folder / "disp0GT.pfm");
  if (sequence.frames[0].truth_occ.empty()) sequence.frames[0].truth_occ = if_there(folder / "disp0.pfm");
  return sequence;
}

StereoSequence open_patterns(const std::string& left, const std::string& right, const fs::path& calibration_file,
                             FrameRange range) {
  const NameParts left_parts = parse_pattern(left), right_parts = parse_pattern(right);
  if (left_parts.kind != right_parts.kind) {
    throw InvalidArgument("patterns '" + left + "' and '" + right + "': both must hold a %d, or both a *, or neither");
  }
  StereoSequence sequence;
  sequence.title = left + " and " + right;
  if (left_parts.kind == 'd') {
    sequence.frames =
        select_frames({left_parts.folder, left_parts.prefix, left_parts.suffix, left_parts.digits},
                      {right_parts.folder, right_parts.prefix, right_parts.suffix, right_parts.digits}, range, left);
  } else if (left_parts.kind == '*') {
    sequence.frames = open_globs(left_parts, right_parts, range, left);
  } else {
    sequence.frames = open_pair(left_parts, right_parts, range, left);
  }
  sequence.calibration_file = calibration_file;
  sequence.calibration = read_calibration(calibration_file, cameras_of(left_parts.folder));
  return sequence;
}

StereoSequence open_folder(const fs::path& folder, FrameRange range) {
  require_folder(folder, "give the folder of a stereo sequence");
  if (is_folder(folder / kRawGrey.left) || is_folder(folder / kRawColor.left)) return open_kitti_raw(folder, range);
  if (is_folder(folder / kGrey.left) || is_folder(folder / kColor.left)) return open_kitti_odometry(folder, range);
  if (is_file(folder / "im0.png")) return open_middlebury(folder);
  throw InvalidArgument(
      folder.string() +
      ": is no stereo sequence; give a folder with image_0 and image_1, image_00/data and image_01/data, "
      "or im0.png and im1.png");
}

StereoImages read_images(const StereoFrame& frame) {
  StereoImages images{read_grey_png(frame.left), read_grey_png(frame.right)};
  const auto describe_image = [](const cv::Mat& image) {
    return std::to_string(image.cols) + "x" + std::to_string(image.rows) + ", " +
           std::to_string(8 * image.elemSize1()) + " bit";
  };
  if (images.left.size() != images.right.size() || images.left.type() != images.right.type()) {
    throw InvalidArgument(frame.right.string() + ": " + describe_image(images.right) + ", but its left image " +
                          frame.left.string() + " has " + describe_image(images.left) + "; give a rectified pair");
  }
  return images;
}

cv::Size check_image_sizes(const StereoSequence& sequence) {
  std::optional<cv::Size> expected;
  for (const StereoFrame& frame : sequence.frames) {
    for (const fs::path& file : {frame.left, frame.right}) {
      const cv::Size size = read_png_size(file);
      if (!expected) expected = size;
      if (size == *expected) continue;
      throw InvalidArgument(file.string() + ": " + std::to_string(size.width) + "x" + std::to_string(size.height) +
                            ", but the sequence began with " + std::to_string(expected->width) + "x" +
                            std::to_string(expected->height) + "; select frames of one size with --frames");
    }
  }
  return expected.value_or(cv::Size());
}

std::vector<Eigen::Isometry3d> poses_of_frames(const StereoSequence& sequence, const fs::path& poses_file) {
  std::vector<Eigen::Isometry3d> rows = read_poses(poses_file);
  const auto last = static_cast<std::size_t>(sequence.frames.back().number);
  if (rows.size() > last) {
    std::vector<Eigen::Isometry3d> poses;
    for (const StereoFrame& frame : sequence.frames) poses.push_back(rows[static_cast<std::size_t>(frame.number)]);
    return poses;
  }
  if (rows.size() == sequence.frames.size()) return rows;
  throw InvalidArgument(poses_file.string() + ": holds " + std::to_string(rows.size()) + " poses, but frames " +
                        std::to_string(sequence.frames.front().number) + ".." + std::to_string(last) +
                        " need a row each, or rows from frame 0 on");
}

}  // namespace egosgm::vision
