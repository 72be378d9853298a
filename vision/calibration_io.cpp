// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/calibration_io.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "egosgm/error.h"
#include "egosgm/vision/image_io.h"
#include "kernels/method.h"
#include "vision/file_io.h"
#include "vision/text_rows.h"

namespace egosgm::vision {
namespace {

constexpr std::size_t kMaxCalibrationBytes = std::size_t{1} << 20;
constexpr double kMaxRelativeFocalDifference = 1e-3;
constexpr std::array<std::string_view, 6> kOwnKeys = {"fx", "fy", "cx", "cy", "baseline_m", "doffs_px"};

struct Entry {
  int row = 0;
  std::string_view key, value;
};

/// A calibration file as keys and values.
class Entries {
 public:
  Entries(const std::filesystem::path& file, std::string_view text) : file_(file) {
    for (const TextRow& row : split_rows(text, file)) add(row);
  }

  const std::filesystem::path& file() const { return file_; }
  const std::vector<Entry>& all() const { return entries_; }
  bool has(std::string_view key) const { return find(key) != nullptr; }

  bool has_prefix(std::string_view prefix) const {
    return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.key.starts_with(prefix); });
  }

  const Entry& at(std::string_view key, const std::string& remedy) const {
    if (const Entry* entry = find(key)) return *entry;
    throw InvalidArgument(file_.string() + ": has no row " + std::string(key) + "; " + remedy);
  }

 private:
  void add(const TextRow& row) {
    const std::string_view text = trim(row.text.substr(0, row.text.find('#')));
    if (text.empty() || text.starts_with('%') || text == "---") return;
    const std::size_t separator = text.find_first_of(":=");
    if (separator == std::string_view::npos) {
      refuse_row(file_, row.number, quoted(text) + " is not `key: value` or `key = value`; give a calibration file");
    }
    const Entry entry{row.number, trim(text.substr(0, separator)), trim(text.substr(separator + 1))};
    const auto [first, is_new] = places_.emplace(entry.key, entries_.size());
    if (!is_new) {
      refuse_row(file_, row.number,
                 quoted(entry.key) + " was given in row " + std::to_string(entries_[first->second].row) +
                     " already; remove one of them");
    }
    entries_.push_back(entry);
  }

  const Entry* find(std::string_view key) const {
    const auto found = places_.find(key);
    return found == places_.end() ? nullptr : &entries_[found->second];
  }

  std::filesystem::path file_;
  std::vector<Entry> entries_;
  std::map<std::string_view, std::size_t> places_;  // in entries_, by key
};

double parse_finite(const Entries& entries, const Entry& entry, std::string_view token) {
  const std::optional<double> number = parse_number(token);
  if (!number || !std::isfinite(*number)) {
    refuse_row(entries.file(), entry.row,
               std::string(entry.key) + ": " + quoted(token) + " is not a finite number; correct it");
  }
  return *number;
}

std::vector<double> parse_numbers(const Entries& entries, const Entry& entry, std::string_view text,
                                  std::size_t count) {
  const std::vector<std::string_view> tokens = split_tokens(text);
  if (tokens.size() != count) {
    refuse_row(entries.file(), entry.row,
               std::string(entry.key) + " has " + std::to_string(tokens.size()) + " numbers instead of " +
                   std::to_string(count) + "; is the row complete?");
  }
  std::vector<double> numbers;
  numbers.reserve(count);
  for (std::string_view token : tokens) numbers.push_back(parse_finite(entries, entry, token));
  return numbers;
}

void check_focal_length(const Entries& entries, const Entry& entry, double fx, double fy) {
  if (fx > 0 && fy > 0) return;
  refuse_row(entries.file(), entry.row,
             std::string(entry.key) + ": the focal length is " + std::to_string(fx > 0 ? fy : fx) +
                 " px; it must be positive");
}

void check_baseline(const Entries& entries, const Entry& entry, double baseline_m) {
  if (baseline_m > 0 && std::isfinite(baseline_m)) return;
  const std::string text = entries.file().string() + ":" + std::to_string(entry.row) + ": " + std::string(entry.key) +
                           ": the baseline is " + std::to_string(baseline_m) + " m; it must be positive";
  if (!(baseline_m < 0)) throw InvalidArgument(text + ", give the distance of the two cameras");
  throw NegativeBaseline(text + " (are left and right swapped?)");
}

/// One camera of a pair, as its row has it.
struct Camera {
  const Entry& row;
  double fx, fy, cx, cy;
};

/// The pixels of a row of one image are on that row of the other one.
void check_rectified(const Entries& entries, const Camera& right, const Camera& left) {
  for (const auto& [of_left, of_right] : {std::pair{left.fx, right.fx}, {left.fy, right.fy}}) {
    if (std::abs(of_left - of_right) <= kMaxRelativeFocalDifference * of_left) continue;
    refuse_row(entries.file(), right.row.row,
               std::string(right.row.key) + ": the focal lengths of left and right, " + std::to_string(of_left) +
                   " and " + std::to_string(of_right) + " px, differ; give the calibration of a rectified pair");
  }
  if (std::abs(left.cy - right.cy) <= EGOSGM_MAX_OFFSET_PX) return;
  refuse_row(entries.file(), right.row.row,
             std::string(right.row.key) + ": the rows of left and right, cy " + std::to_string(left.cy) + " and " +
                 std::to_string(right.cy) + " px, differ; give the calibration of a rectified pair");
}

/// `of_baseline`: the row that tells it.
Calibration from_pair(const Entries& entries, const Camera& left, const Camera& right, const Entry& of_baseline,
                      double baseline_m, double doffs_px) {
  check_focal_length(entries, left.row, left.fx, left.fy);
  check_focal_length(entries, right.row, right.fx, right.fy);
  check_rectified(entries, right, left);
  check_baseline(entries, of_baseline, baseline_m);
  return {left.fx, left.fy, left.cx, left.cy, baseline_m, doffs_px};
}

[[noreturn]] void refuse_transposed(const Entries& entries, const Entry& entry) {
  refuse_row(entries.file(), entry.row,
             std::string(entry.key) + " is transposed, as MATLAB writes it: give its numbers row by row");
}

/// The projection matrix of a row.
std::vector<double> parse_projection(const Entries& entries, const Entry& entry) {
  std::vector<double> p = parse_numbers(entries, entry, entry.value, 12);
  if (p[5] == 0 && p[4] != 0) refuse_transposed(entries, entry);  // fy
  return p;
}

/// Throws InvalidArgument where both cameras' rows T say another distance than the projection matrices: in files of
/// images that were made smaller, the last column of P may be that of the large ones.
void check_translations(const Entries& entries, const Entry& left, const Entry& right, double baseline_m) {
  constexpr std::string_view kPrefix = "P_rect_";
  constexpr double kMostDifference = 0.05;  // of turned cameras, and of digits that are few
  const auto key_of = [&](const Entry& entry) { return "T_" + std::string(entry.key.substr(kPrefix.size())); };
  if (!left.key.starts_with(kPrefix) || !entries.has(key_of(left)) || !entries.has(key_of(right))) return;
  double square = 0;
  const Entry& of_left = entries.at(key_of(left), "");
  const Entry& of_right = entries.at(key_of(right), "");
  const std::vector<double> a = parse_numbers(entries, of_left, of_left.value, 3);
  const std::vector<double> b = parse_numbers(entries, of_right, of_right.value, 3);
  for (std::size_t i = 0; i < a.size(); ++i) square += (a[i] - b[i]) * (a[i] - b[i]);
  const double distance_m = std::sqrt(square);
  if (std::abs(distance_m - baseline_m) <= kMostDifference * distance_m) return;
  refuse_row(entries.file(), right.row,
             std::string(right.key) + " gives a baseline of " + std::to_string(baseline_m) + " m, " +
                 std::string(of_right.key) + " one of " + std::to_string(distance_m) +
                 " m: where images were made smaller, as DrivingStereo's of half size, the last column of P may have "
                 "stayed as it was, and T is right; give rows of fx, fy, cx, cy and the true baseline_m");
}

Calibration from_projections(const Entries& entries, const std::string& left_key, const std::string& right_key) {
  const std::string remedy = "give the calibration of cameras " + left_key + " and " + right_key;
  const Entry& left = entries.at(left_key, remedy);
  const Entry& right = entries.at(right_key, remedy);
  const std::vector<double> p_left = parse_projection(entries, left);
  const std::vector<double> p_right = parse_projection(entries, right);
  const double baseline_m = (p_left[3] - p_right[3]) / p_left[0];
  const Calibration calibration =
      from_pair(entries, {left, p_left[0], p_left[5], p_left[2], p_left[6]},
                {right, p_right[0], p_right[5], p_right[2], p_right[6]}, right, baseline_m, p_right[2] - p_left[2]);
  check_translations(entries, left, right, baseline_m);
  return calibration;
}

/// The image's size of a row or of two rows; 0 where they are not there.
void read_size(const Entries& entries, const std::vector<std::string>& keys, SizedCalibration& found) {
  std::vector<double> size;
  for (const std::string& key : keys) {
    if (!entries.has(key)) return;
    const Entry& entry = entries.at(key, "");
    for (const std::string_view token : split_tokens(entry.value)) size.push_back(parse_finite(entries, entry, token));
  }
  if (size.size() != 2) return;
  for (const double side : size) {
    if (!(side >= 1 && side <= kMaxImageSide)) return;
  }
  found.width = static_cast<int>(std::lround(size[0]));
  found.height = static_cast<int>(std::lround(size[1]));
}

/// The names of the left and the right camera, of KITTI's four, or of the only two that there are.
std::pair<std::string, std::string> names_of_cameras(const Entries& entries, KittiCameras cameras,
                                                     const std::string& prefix) {
  const std::string zero = prefix == "P" ? "" : "0";
  std::set<std::string> names;
  for (const Entry& entry : entries.all()) {
    if (entry.key.starts_with(prefix) && prefix != "P") names.emplace(entry.key.substr(prefix.size()));
  }
  const bool is_kitti = std::any_of(names.begin(), names.end(), [](const std::string& name) { return name[0] == '0'; });
  if (!is_kitti && names.size() == 2) return {*names.begin(), *names.rbegin()};
  if (!is_kitti && names.size() == 1) {
    throw InvalidArgument(entries.file().string() + ": has the camera " + prefix + *names.begin() +
                          " alone; give the calibration of both");
  }
  const bool grey =
      cameras == KittiCameras::kGrey ||
      (cameras == KittiCameras::kAny && (entries.has(prefix + zero + "0") || !entries.has(prefix + zero + "2")));
  return grey ? std::pair{zero + "0", zero + "1"} : std::pair{zero + "2", zero + "3"};
}

SizedCalibration from_kitti(const Entries& entries, KittiCameras cameras, const std::string& prefix) {
  const auto [left, right] = names_of_cameras(entries, cameras, prefix);
  SizedCalibration found{from_projections(entries, prefix + left, prefix + right)};
  if (prefix != "P") read_size(entries, {"S_rect_" + left}, found);
  return found;
}

std::vector<double> parse_middlebury_matrix(const Entries& entries, const Entry& entry) {
  std::string text(entry.value);
  for (char& c : text) c = c == '[' || c == ']' || c == ';' || c == ',' ? ' ' : c;
  std::vector<double> k = parse_numbers(entries, entry, text, 9);
  if (k[2] == 0 && k[5] == 0 && (k[6] != 0 || k[7] != 0)) refuse_transposed(entries, entry);
  return k;
}

SizedCalibration from_middlebury(const Entries& entries) {
  const std::string remedy = "give a complete calib.txt";
  const Entry& left = entries.at("cam0", remedy);
  const Entry& right = entries.at("cam1", remedy);
  const Entry& baseline = entries.at("baseline", remedy);
  const std::vector<double> k_left = parse_middlebury_matrix(entries, left);
  const std::vector<double> k_right = parse_middlebury_matrix(entries, right);
  const double doffs_px = entries.has("doffs")
                              ? parse_finite(entries, entries.at("doffs", remedy), entries.at("doffs", remedy).value)
                              : k_right[2] - k_left[2];
  SizedCalibration found{from_pair(entries, {left, k_left[0], k_left[4], k_left[2], k_left[5]},
                                   {right, k_right[0], k_right[4], k_right[2], k_right[5]}, baseline,
                                   parse_finite(entries, baseline, baseline.value) / 1000.0, doffs_px)};
  read_size(entries, {"width", "height"}, found);
  return found;
}

Calibration from_own(const Entries& entries) {
  for (const Entry& entry : entries.all()) {
    if (std::find(kOwnKeys.begin(), kOwnKeys.end(), entry.key) != kOwnKeys.end()) continue;
    refuse_row(entries.file(), entry.row,
               "unknown key " + quoted(entry.key) + "; the keys are fx, fy, cx, cy, baseline_m and doffs_px");
  }
  const auto number = [&](std::string_view key) {
    const Entry& entry = entries.at(key, "the keys are fx, fy, cx, cy, baseline_m and, if not zero, doffs_px");
    return parse_finite(entries, entry, entry.value);
  };
  Calibration calibration{.fx = number("fx"),
                          .fy = number("fy"),
                          .cx = number("cx"),
                          .cy = number("cy"),
                          .baseline_m = number("baseline_m"),
                          .doffs_px = entries.has("doffs_px") ? number("doffs_px") : 0.0};
  check_focal_length(entries, entries.at("fx", ""), calibration.fx, calibration.fx);
  check_focal_length(entries, entries.at("fy", ""), calibration.fy, calibration.fy);
  check_baseline(entries, entries.at("baseline_m", ""), calibration.baseline_m);
  return calibration;
}

bool has_all(std::string_view text, std::initializer_list<std::string_view> words) {
  return std::all_of(words.begin(), words.end(),
                     [&](std::string_view word) { return text.find(word) != std::string_view::npos; });
}

/// Names the format of a file that is none of those here; empty where it is not known.
std::string_view foreign_format(std::string_view text) {
  struct Format {
    std::initializer_list<std::string_view> words;
    std::string_view name;
  };
  static const std::array<Format, 19> kFormats{{
      {{"T_cn_cnm1"}, "a camera chain of Kalibr"},
      {{"cam0:", "camera_model:", "intrinsics:"},
       "a camera chain of Kalibr without T_cn_cnm1, where the second camera stands"},
      {{"camera_matrix", "projection_matrix"},
       "a camera of ROS's calibrator, which needs the other one's file beside it"},
      {{"T_BS", "intrinsics"}, "one camera of EuRoC or Kimera, which needs the other one's file beside it"},
      {{"disparity_to_depth"}, "DSEC's cam_to_cam.yaml"},
      {{"Camera1.fx"}, "a file of settings of ORB-SLAM3"},
      {{"Camera.fx"}, "a file of settings of ORB-SLAM"},
      {{"\"extrinsic\"", "\"u0\""}, "Cityscapes' camera.json"},
      {{"LEFT_CAM"}, "a calibration file of a ZED camera"},
      {{"\nC =", "\nA =", "\nH =", "\nV ="},
       "one camera of a rover (CAHV), which needs the other one's file beside it"},
      {{"camera_matrix"}, "OpenCV's calibration of one camera"},
      {{"intrinsic", "T_"}, "a YAML or JSON file of intrinsics and transformations"},
      {{"left_camera_matrix"}, "OpenCV's stereo calibration (of raw images)"},
      {{"M1", "M2"}, "OpenCV's stereo calibration (of raw images)"},
      {{"K1", "K2"}, "OpenCV's stereo calibration (of raw images)"},
      {{"Matrix1", "Matrix2"}, "OpenCV's stereo calibration (of raw images)"},
      {{"MatrixL", "MatrixR"}, "OpenCV's stereo calibration (of raw images)"},
      {{"Camera list with one line of data"}, "COLMAP's cameras.txt, which does not say how two cameras stand"},
      {{"Q:"}, "a matrix Q of OpenCV's stereoRectify"},
  }};
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) return "UTF-16, which is to be saved as UTF-8";
  if (text.size() > 1 && (text[0] == '\0') != (text[1] == '\0')) return "UTF-16, which is to be saved as UTF-8";
  if (text.starts_with("\x1f\x8b")) return "packed by gzip";
  if (text.starts_with("PK\x03\x04")) return "an archive of NumPy arrays (.npz)";
  if (text.starts_with("\x93NUMPY")) return "one NumPy array";
  if (text.starts_with("\x89HDF")) return "HDF5, as MATLAB writes it";
  if (text.starts_with("\x89PNG") || text.starts_with("\xff\xd8\xff")) return "a picture";
  for (const Format& format : kFormats) {
    if (has_all(text, format.words)) return format.name;
  }
  if (text.starts_with("%YAML")) return "a YAML file of OpenCV";
  const std::size_t begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string_view::npos) return {};
  if (text[begin] == '[' && text.find('=') != std::string_view::npos)
    return "INI or TOML, whose rows stand in sections";
  if (text[begin] == '{' || text[begin] == '[') return "JSON";
  if (text[begin] == '<') return "XML, as OpenCV writes it";
  const std::vector<std::string_view> numbers = split_tokens(text.substr(0, text.find('\n')));
  const bool is_matrix = numbers.size() == 9 || numbers.size() == 3;
  if (is_matrix &&
      std::all_of(numbers.begin(), numbers.end(), [](auto token) { return parse_number(token).has_value(); }))
    return "a plain camera matrix, FoundationStereo's K.txt for instance";
  return {};
}

[[noreturn]] void refuse_foreign(const std::filesystem::path& file, std::string_view format) {
  throw InvalidArgument(
      file.string() + ": is " + std::string(format) +
      ", not one of EgoSGM's formats for rectified images (fx, fy, cx, cy, baseline_m in rows; KITTI's; "
      "Middlebury's). A stereo calibration of OpenCV goes to `egosgm rectify`; the Python package "
      "reads more of them: egosgm.read_calibration, and --calib of its `egosgm` command");
}

}  // namespace

Calibration read_calibration(const std::filesystem::path& file, KittiCameras cameras) {
  return read_sized_calibration(file, cameras).calibration;
}

SizedCalibration read_sized_calibration(const std::filesystem::path& file, KittiCameras cameras) {
  const std::string text = read_file(file, kMaxCalibrationBytes);
  const bool is_own = has_all(text, {"baseline_m"}) && text.find('{') == std::string::npos;
  if (const std::string_view format = is_own ? "" : foreign_format(text); !format.empty()) refuse_foreign(file, format);
  const Entries entries(file, text);
  if (entries.has_prefix("P_rect_")) return from_kitti(entries, cameras, "P_rect_");
  if (entries.has("cam0") || entries.has("cam1")) return from_middlebury(entries);
  if (std::any_of(kOwnKeys.begin(), kOwnKeys.end(), [&](std::string_view key) { return entries.has(key); })) {
    return {from_own(entries)};
  }
  for (const char* key : {"P0", "P1", "P2", "P3"}) {
    if (entries.has(key)) return from_kitti(entries, cameras, "P");
  }
  throw InvalidArgument(
      file.string() +
      ": holds no calibration; give KITTI's (P0: or P_rect_00:), Middlebury's (cam0=) or rows of fx, fy, "
      "cx, cy, baseline_m; what others wrote (f, B, a field of view) goes to --calib beside --left and --right, which "
      "need the Python package for it");
}

void write_calibration(const std::filesystem::path& file, const Calibration& calibration) {
  calibration.validate();
  const std::array<double, 6> values = {calibration.fx, calibration.fy,         calibration.cx,
                                        calibration.cy, calibration.baseline_m, calibration.doffs_px};
  std::string text;
  for (std::size_t i = 0; i < values.size(); ++i) {
    text.append(kOwnKeys[i]).append(" = ");
    append_number(text, values[i], 16);
    text += '\n';
  }
  write_file(file, text);
}

}  // namespace egosgm::vision
