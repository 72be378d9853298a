// SPDX-License-Identifier: Apache-2.0
#include "apps/stereo_rig.h"

#include <fmt/core.h>

#include <cmath>
#include <initializer_list>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "egosgm/error.h"
#include "egosgm/vision/file_io.h"

namespace egosgm::app {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxBytes = std::size_t{1} << 22;
constexpr double kMaxBaseline_m = 10;

using Names = std::initializer_list<const char*>;

/// What OpenCV throws over a file's contents is the file's fault.
template <typename Read>
auto blaming(const fs::path& file, Read&& read) {
  try {
    return read();
  } catch (const cv::Exception& error) {
    throw InvalidArgument(fmt::format("{}: holds no calibration that can be read: {}", file.string(), error.err));
  }
}

/// A file of OpenCV's cv::FileStorage, also without its header, as others write YAML.
cv::FileStorage open_storage(const fs::path& file) {
  std::string text = vision::read_file(file, kMaxBytes);
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
    for (const cv::FileNode& number : node) {
      if (!number.isInt() && !number.isReal()) return {};
      numbers.push_back(static_cast<double>(number));
    }
    matrix = cv::Mat(numbers, /*copyData=*/true);
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
  if (matrix.empty()) throw InvalidArgument(fmt::format("{}: has no {}", file.string(), name));
  if (matrix.total() != elements || !cv::checkRange(matrix)) {
    throw InvalidArgument(fmt::format("{}: {} must hold {} finite numbers", file.string(), name, elements));
  }
  return matrix;
}

cv::Mat require_distortion(const cv::Mat& matrix, const fs::path& file, const char* name, bool is_fisheye) {
  if (matrix.empty()) return cv::Mat::zeros(is_fisheye ? 4 : 5, 1, CV_64F);
  if (is_fisheye && matrix.total() != 4) {
    throw InvalidArgument(
        fmt::format("{}: {} has {} numbers; OpenCV's fisheye model has 4", file.string(), name, matrix.total()));
  }
  for (const std::size_t count : {4, 5, 8, 12, 14}) {
    if (matrix.total() == count && cv::checkRange(matrix)) return matrix.reshape(1, static_cast<int>(count));
  }
  throw InvalidArgument(
      fmt::format("{}: {} has {} numbers; OpenCV's model has 4, 5, 8, 12 or 14", file.string(), name, matrix.total()));
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

/// Rounded to a few digits, as files have them.
void check_rotation(const char* name, const cv::Mat& R) {
  constexpr double kMaxError = 1e-2;
  const double error = cv::norm(R * R.t() - cv::Mat::eye(3, 3, CV_64F), cv::NORM_INF);
  if (error <= kMaxError && cv::determinant(R) > 0) return;
  throw InvalidArgument(fmt::format(
      "{} is no rotation: its rows are not of length 1 and at right angles; give the calibration as it was computed",
      name));
}

void check_stance(const cv::Mat& T) {
  const double x = T.at<double>(0), y = T.at<double>(1), z = T.at<double>(2);
  if (std::abs(x) < std::abs(y) || std::abs(x) < std::abs(z)) {
    throw InvalidArgument(fmt::format(
        "T = ({:.4g}, {:.4g}, {:.4g}) m: the cameras do not stand side by side; turn the images by 90 degrees", x, y,
        z));
  }
  if (x > 0) {
    throw InvalidArgument(fmt::format(
        "T = ({:.4g}, {:.4g}, {:.4g}) m: the second camera stands left of the first: exchange left and right, images "
        "and calibration",
        x, y, z));
  }
  if (-x > kMaxBaseline_m) {
    throw InvalidArgument(fmt::format("the baseline is {:.4g} m: is T in millimetres? give --unit mm", -x));
  }
}

/// The largest upright rectangle of valid pixels (one pass over histograms of columns).
cv::Rect largest_rectangle(const cv::Mat& valid) {
  cv::Rect best;
  std::vector<int> heights(static_cast<std::size_t>(valid.cols) + 1, 0);
  for (int y = 0; y < valid.rows; ++y) {
    std::vector<int> open;
    for (int x = 0; x <= valid.cols; ++x) {
      const auto at = static_cast<std::size_t>(x);
      heights[at] = x < valid.cols && valid.at<std::uint8_t>(y, x) ? heights[at] + 1 : 0;
      while (!open.empty() && heights[static_cast<std::size_t>(open.back())] >= heights[at]) {
        const int height = heights[static_cast<std::size_t>(open.back())];
        open.pop_back();
        const int left = open.empty() ? 0 : open.back() + 1;
        if (height * (x - left) > best.area()) best = {left, y - height + 1, x - left, height};
      }
      open.push_back(x);
    }
  }
  return best;
}

std::optional<StereoRig> opencv_rig(const fs::path& file, double unit_m, bool is_fisheye) {
  std::vector<cv::FileStorage> files;
  if (fs::is_directory(file)) {
    for (const char* name : {"intrinsics.yml", "extrinsics.yml"}) files.push_back(open_storage(file / name));
  } else {
    try {
      files.push_back(open_storage(file));
    } catch (const InvalidArgument&) {
      if (vision::read_file_start(file, 5) == "%YAML") throw;
      return std::nullopt;  // one of the formats that are no YAML
    }
  }
  const cv::Mat left = find_matrix(files, {"M1", "K1", "cameraMatrix1", "camera_matrix_1", "cameraMatrixL", "KL"});
  if (left.empty()) return std::nullopt;
  StereoRig rig;
  rig.is_fisheye = is_fisheye;
  const auto matrix = [&](const char* name, std::size_t elements, Names names) {
    return require_matrix(find_matrix(files, names), file, name, elements);
  };
  rig.left.matrix = require_matrix(left, file, "M1", 9).reshape(1, 3);
  rig.right.matrix =
      matrix("M2", 9, {"M2", "K2", "cameraMatrix2", "camera_matrix_2", "cameraMatrixR", "KR"}).reshape(1, 3);
  rig.left.distortion = require_distortion(
      find_matrix(files, {"D1", "distCoeffs1", "dist_coeffs_1", "distCoeffsL", "DL"}), file, "D1", is_fisheye);
  rig.right.distortion = require_distortion(
      find_matrix(files, {"D2", "distCoeffs2", "dist_coeffs_2", "distCoeffsR", "DR"}), file, "D2", is_fisheye);
  rig.R = find_matrix(files, {"R"});
  if (rig.R.total() == 3) cv::Rodrigues(rig.R.clone(), rig.R);
  rig.R = require_matrix(rig.R, file, "R", 9).reshape(1, 3);
  rig.T = matrix("T", 3, {"T"}).reshape(1, 3) * unit_m;
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
    const fs::path file = mav0 / fmt::format("cam{}", i) / "sensor.yaml";
    const std::vector<cv::FileStorage> files{open_storage(file)};
    const cv::Mat k = require_matrix(find_matrix(files, {"intrinsics"}), file, "intrinsics", 4);
    const std::string model = files[0]["distortion_model"].string();
    if (model != "radial-tangential" && model != "equidistant") {
      throw InvalidArgument(fmt::format("{}: distortion_model \"{}\": only radial-tangential and equidistant are known",
                                        file.string(), model));
    }
    const bool is_fisheye = model == "equidistant";
    if (i == 1 && is_fisheye != rig.is_fisheye) {
      throw InvalidArgument(
          fmt::format("{}: distortion_model \"{}\": the other camera has another one: calibrate both "
                      "with one model",
                      file.string(), model));
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

Rectification rectification_of(const StereoRig& rig, cv::Size size, double alpha) {
  if (rig.size && *rig.size != size) {
    throw InvalidArgument(
        fmt::format("the images are {}x{}, but {}x{} were calibrated: give the calibration of this size", size.width,
                    size.height, rig.size->width, rig.size->height));
  }
  check_rotation("R", rig.R);
  if (rig.given[0]) check_rotation("R1", *rig.given[0]);
  if (rig.given[1]) check_rotation("R2", *rig.given[1]);
  check_stance(rig.T);
  cv::Mat R1, R2, P1, P2, Q;
  if (rig.given[0]) {
    R1 = *rig.given[0], R2 = *rig.given[1], P1 = *rig.given[2], P2 = *rig.given[3];
  } else if (rig.is_fisheye) {
    cv::fisheye::stereoRectify(rig.left.matrix, rig.left.distortion, rig.right.matrix, rig.right.distortion, size,
                               rig.R, rig.T, R1, R2, P1, P2, Q, cv::CALIB_ZERO_DISPARITY, size, alpha);
  } else {
    cv::stereoRectify(rig.left.matrix, rig.left.distortion, rig.right.matrix, rig.right.distortion, size, rig.R, rig.T,
                      R1, R2, P1, P2, Q, cv::CALIB_ZERO_DISPARITY, alpha, size);
  }
  Rectification result;
  result.calibration = {.fx = P1.at<double>(0, 0),
                        .fy = P1.at<double>(1, 1),
                        .cx = P1.at<double>(0, 2),
                        .cy = P1.at<double>(1, 2),
                        .baseline_m = -P2.at<double>(0, 3) / P2.at<double>(0, 0),
                        .doffs_px = P2.at<double>(0, 2) - P1.at<double>(0, 2)};
  result.calibration.validate();
  const auto map = [&](const StereoRig::Camera& camera, const cv::Mat& R, const cv::Mat& P, cv::Mat(&maps)[2]) {
    if (rig.is_fisheye) {
      cv::fisheye::initUndistortRectifyMap(camera.matrix, camera.distortion, R, P, size, CV_32FC1, maps[0], maps[1]);
    } else {
      cv::initUndistortRectifyMap(camera.matrix, camera.distortion, R, P, size, CV_32FC1, maps[0], maps[1]);
    }
    cv::Mat valid;
    cv::remap(cv::Mat(size, CV_8UC1, cv::Scalar(255)), valid, maps[0], maps[1], cv::INTER_LINEAR);
    return cv::Mat(valid == 255);
  };
  result.valid = map(rig.left, R1, P1, result.left_map);
  result.valid_left = largest_rectangle(result.valid);
  result.valid_right = largest_rectangle(map(rig.right, R2, P2, result.right_map));
  return result;
}

}  // namespace egosgm::app
