// SPDX-License-Identifier: Apache-2.0
// Calibrations of two cameras, read from files.

#include <initializer_list>
#include <opencv2/calib3d.hpp>
#include <string>
#include <string_view>

#include "egosgm/error.h"
#include "egosgm/vision/rectification.h"
#include "host/vision/file_io.h"

namespace egosgm::vision {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxBytes = std::size_t{1} << 22;

using Names = std::initializer_list<const char*>;

// How programs call the matrices of OpenCV's stereoCalibrate.
constexpr Names kLeftMatrix = {"M1",
                               "K1",
                               "cameraMatrix1",
                               "camera_matrix_1",
                               "cameraMatrixL",
                               "KL",
                               "K_left",
                               "Kl",
                               "left_camera_matrix",
                               "camera_matrix1",
                               "mtx1",
                               "mtxL",
                               "cameraMatrix_left",
                               "intrinsic1",
                               "leftCameraMatrix",
                               "camera_matrix_left",
                               "K_l"};
constexpr Names kRightMatrix = {"M2",
                                "K2",
                                "cameraMatrix2",
                                "camera_matrix_2",
                                "cameraMatrixR",
                                "KR",
                                "K_right",
                                "Kr",
                                "right_camera_matrix",
                                "camera_matrix2",
                                "mtx2",
                                "mtxR",
                                "cameraMatrix_right",
                                "intrinsic2",
                                "rightCameraMatrix",
                                "camera_matrix_right",
                                "K_r"};
constexpr Names kLeftDistortion = {"D1",
                                   "distCoeffs1",
                                   "dist_coeffs_1",
                                   "distCoeffsL",
                                   "DL",
                                   "D_left",
                                   "Dl",
                                   "left_distortion",
                                   "dist_coeffs1",
                                   "dist1",
                                   "distL",
                                   "distCoeffs_left",
                                   "distortion1",
                                   "leftDistCoeffs",
                                   "left_dist_coeffs",
                                   "dist_coeffs_left",
                                   "left_distortion_coefficients",
                                   "D_l"};
constexpr Names kRightDistortion = {"D2",
                                    "distCoeffs2",
                                    "dist_coeffs_2",
                                    "distCoeffsR",
                                    "DR",
                                    "D_right",
                                    "Dr",
                                    "right_distortion",
                                    "dist_coeffs2",
                                    "dist2",
                                    "distR",
                                    "distCoeffs_right",
                                    "distortion2",
                                    "rightDistCoeffs",
                                    "right_dist_coeffs",
                                    "dist_coeffs_right",
                                    "right_distortion_coefficients",
                                    "D_r"};

/// What OpenCV throws over a file's contents is the file's fault.
template <typename Read>
auto blaming(const fs::path& file, Read&& read) {
  try {
    return read();
  } catch (const cv::Exception& error) {
    throw InvalidArgument(file.string() + ": holds no calibration that can be read: " + error.err);
  }
}

/// OpenCV's parsers call themselves for what is nested, as deep as it is: what begins something is counted.
void check_nesting(const std::string& text, const fs::path& file) {
  constexpr int kMost = 2000;
  int begun = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool ends_word =
        i + 1 == text.size() || std::string_view(" \t\r\n").find(text[i + 1]) != std::string_view::npos;
    if (std::string_view("[{<").find(text[i]) != std::string_view::npos) ++begun;
    if (ends_word && (text[i] == ':' || text[i] == '-')) ++begun;
  }
  if (begun <= kMost) return;
  throw InvalidArgument(file.string() + ": has " + std::to_string(begun) + " nested or named parts, the most is " +
                        std::to_string(kMost) + "; give a calibration alone");
}

/// A file of OpenCV's cv::FileStorage, also without its header, as others write YAML.
cv::FileStorage open_storage(const fs::path& file) {
  std::string text = read_file(file, kMaxBytes);
  check_nesting(text, file);
  if (text.find_first_of("<{") != text.find_first_not_of(" \t\r\n") && !text.starts_with("%YAML")) {
    text = "%YAML:1.0\n---\n" + text;
  }
  return blaming(file, [&] { return cv::FileStorage(text, cv::FileStorage::READ | cv::FileStorage::MEMORY); });
}

/// A matrix, or a plain list of numbers as one column. Empty where the node is neither.
cv::Mat matrix_of(const cv::FileNode& node) {
  cv::Mat matrix;
  if (node.isMap()) {
    if (!node["dt"].empty()) {
      node >> matrix;
    } else if (!node["data"].empty()) {  // ROS and EuRoC
      matrix = matrix_of(node["data"]);
      const int rows = static_cast<int>(node["rows"]);
      if (rows > 0 && matrix.total() % static_cast<std::size_t>(rows) == 0) matrix = matrix.reshape(1, rows);
    }
  } else if (node.isSeq()) {
    std::vector<double> numbers;
    cv::Mat rows;
    for (const cv::FileNode& number : node) {
      if (number.isSeq()) {  // a row, as Python writes them
        const cv::Mat row = matrix_of(number);
        if (row.empty() || (!rows.empty() && row.total() != static_cast<std::size_t>(rows.cols))) return {};
        rows.push_back(row.reshape(1, 1));
        continue;
      }
      if (!number.isInt() && !number.isReal()) return {};
      numbers.push_back(static_cast<double>(number));
    }
    if (!rows.empty() && !numbers.empty()) return {};
    matrix = rows.empty() ? cv::Mat(numbers, /*copyData=*/true) : rows;
  }
  if (!matrix.empty()) matrix.convertTo(matrix, CV_64F);
  return matrix;
}

cv::Mat find_matrix(const std::vector<cv::FileStorage>& files, Names names) {
  for (const cv::FileStorage& file : files) {
    for (const char* name : names) {
      cv::Mat found = matrix_of(file[name]);
      if (!found.empty()) return found;
    }
  }
  return {};
}

cv::Mat require_matrix(const cv::Mat& matrix, const fs::path& file, const char* name, std::size_t elements) {
  if (matrix.empty()) throw InvalidArgument(file.string() + ": has no " + name);
  if (matrix.total() != elements || !cv::checkRange(matrix)) {
    throw InvalidArgument(file.string() + ": " + name + " must hold " + std::to_string(elements) + " finite numbers");
  }
  return matrix;
}

cv::Mat require_distortion(const cv::Mat& matrix, const fs::path& file, const char* name, bool is_fisheye) {
  if (matrix.empty()) return cv::Mat::zeros(is_fisheye ? 4 : 5, 1, CV_64F);
  if (is_fisheye && matrix.total() != 4) {
    throw InvalidArgument(file.string() + ": " + name + " has " + std::to_string(matrix.total()) +
                          " numbers; OpenCV's fisheye model has 4");
  }
  for (const std::size_t count : {4, 5, 8, 12, 14}) {
    if (matrix.total() == count && cv::checkRange(matrix)) return matrix.reshape(1, static_cast<int>(count));
  }
  throw InvalidArgument(file.string() + ": " + name + " has " + std::to_string(matrix.total()) +
                        " numbers; OpenCV's model has 4, 5, 8, 12 or 14");
}

std::optional<cv::Size> find_size(const std::vector<cv::FileStorage>& files) {
  for (const cv::FileStorage& file : files) {
    for (const char* name : {"size", "image_size", "imageSize", "resolution"}) {
      const cv::Mat numbers = matrix_of(file[name]);
      if (numbers.total() == 2) return cv::Size(int(numbers.at<double>(0)), int(numbers.at<double>(1)));
    }
    const int width = int(file["image_width"]), height = int(file["image_height"]);
    if (width > 0 && height > 0) return cv::Size(width, height);
  }
  return std::nullopt;
}

std::optional<StereoRig> opencv_rig(const fs::path& file, double unit_m, bool is_fisheye) {
  std::vector<cv::FileStorage> files;
  if (fs::is_directory(file)) {
    for (const char* name : {"intrinsics.yml", "extrinsics.yml"}) files.push_back(open_storage(file / name));
  } else {
    try {
      files.push_back(open_storage(file));
    } catch (const InvalidArgument&) {
      const std::string start = read_file_start(file, 5);
      if (start == "%YAML" || start.starts_with('{') || start.starts_with('<')) throw;
      return std::nullopt;  // one of the formats that are none of OpenCV's
    }
  }
  const cv::Mat left = find_matrix(files, kLeftMatrix);
  if (left.empty()) return std::nullopt;
  StereoRig rig;
  rig.is_fisheye = is_fisheye;
  const auto matrix = [&](const char* name, std::size_t elements, Names names) {
    return require_matrix(find_matrix(files, names), file, name, elements);
  };
  rig.left.matrix = require_matrix(left, file, "M1", 9).reshape(1, 3);
  rig.right.matrix = matrix("M2", 9, kRightMatrix).reshape(1, 3);
  rig.left.distortion = require_distortion(find_matrix(files, kLeftDistortion), file, "D1", is_fisheye);
  rig.right.distortion = require_distortion(find_matrix(files, kRightDistortion), file, "D2", is_fisheye);
  rig.R = find_matrix(files, {"R", "rotation", "Rot", "om"});
  if (rig.R.total() == 3) cv::Rodrigues(rig.R.clone(), rig.R);
  rig.R = require_matrix(rig.R, file, "R", 9).reshape(1, 3);
  rig.T = matrix("T", 3, {"T", "t", "translation", "Trans"}).reshape(1, 3) * unit_m;
  rig.size = find_size(files);
  const cv::Mat given[4] = {find_matrix(files, {"R1"}), find_matrix(files, {"R2"}), find_matrix(files, {"P1"}),
                            find_matrix(files, {"P2"})};
  if (given[0].total() == 9 && given[1].total() == 9 && given[2].total() == 12 && given[3].total() == 12) {
    for (int i = 0; i < 4; ++i) rig.given[i] = given[i].reshape(1, 3);
    (*rig.given[3]).col(3) *= unit_m;
  }
  return rig;
}

StereoRig euroc_rig(const fs::path& mav0) {
  StereoRig rig;
  cv::Mat body_from_camera[2];
  for (int i = 0; i < 2; ++i) {
    const fs::path file = mav0 / (i == 0 ? "cam0" : "cam1") / "sensor.yaml";
    const std::vector<cv::FileStorage> files{open_storage(file)};
    const cv::Mat k = require_matrix(find_matrix(files, {"intrinsics"}), file, "intrinsics", 4);
    const std::string model = files[0]["distortion_model"].string();
    const std::string named = file.string() + ": distortion_model \"" + model + "\": ";
    if (model != "radial-tangential" && model != "radtan" && model != "equidistant") {
      throw InvalidArgument(named + "only radial-tangential and equidistant are known");
    }
    const bool is_fisheye = model == "equidistant";
    if (i == 1 && is_fisheye != rig.is_fisheye) {
      throw InvalidArgument(named + "the other camera has another one: calibrate both with one model");
    }
    rig.is_fisheye = is_fisheye;
    StereoRig::Camera& camera = i == 0 ? rig.left : rig.right;
    camera.matrix =
        (cv::Mat_<double>(3, 3) << k.at<double>(0), 0, k.at<double>(2), 0, k.at<double>(1), k.at<double>(3), 0, 0, 1);
    camera.distortion = require_distortion(find_matrix(files, {"distortion_coefficients"}), file,
                                           "distortion_coefficients", is_fisheye);
    body_from_camera[i] = require_matrix(find_matrix(files, {"T_BS"}), file, "T_BS", 16).reshape(1, 4);
    if (i == 0) rig.size = find_size(files);
  }
  const cv::Mat right_from_left = body_from_camera[1].inv() * body_from_camera[0];
  rig.R = right_from_left(cv::Rect(0, 0, 3, 3)).clone();
  rig.T = right_from_left(cv::Rect(3, 0, 1, 3)).clone();
  return rig;
}

}  // namespace

std::optional<StereoRig> read_opencv_rig(const fs::path& file, double unit_m, bool is_fisheye) {
  return blaming(file, [&] { return opencv_rig(file, unit_m, is_fisheye); });
}

StereoRig read_euroc_rig(const fs::path& mav0) {
  return blaming(mav0, [&] { return euroc_rig(mav0); });
}

}  // namespace egosgm::vision
