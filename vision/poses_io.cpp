// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/poses_io.h"

#include <Eigen/SVD>
#include <cmath>
#include <optional>
#include <string>

#include "egosgm/error.h"
#include "vision/file_io.h"
#include "vision/text_rows.h"

namespace egosgm::vision {
namespace {

constexpr std::size_t kMaxPosesBytes = std::size_t{1} << 28;
constexpr double kMaxRotationError = 1e-4;

/// Names rows of other lengths.
std::string other_poses(const std::vector<std::string_view>& tokens) {
  if (!tokens.empty() && tokens[0].starts_with('#')) return ": it is a comment, as in TUM's files";
  switch (tokens.size()) {
    case 4:
      return ", as of 4x4 matrices: write the first three rows of each in one";
    case 7:
      return ", as TartanAir's (x y z and a quaternion, in NED's axes): turn its axes, and write matrices";
    case 8:
      return ", as TUM's (a time, x y z, a quaternion): `evo_traj tum FILE --save_as_kitti` converts it";
    case 16:
      return ", as of whole 4x4 matrices: leave out each one's last four";
    case 17:
      return ", as of a time or a number before a 4x4 matrix: leave it and the last four out";
    default:
      return "";
  }
}

Eigen::Matrix<double, 3, 4> parse_row(const std::filesystem::path& file, const TextRow& row) {
  const std::vector<std::string_view> tokens = split_tokens(row.text);
  if (tokens.size() != 12) {
    refuse_row(file, row.number,
               "a pose is a row of 12 numbers, this one has " + std::to_string(tokens.size()) + other_poses(tokens) +
                   "; give KITTI poses without blank rows");
  }
  Eigen::Matrix<double, 3, 4> pose;
  for (int i = 0; i < 12; ++i) {
    const std::optional<double> number = parse_number(tokens[static_cast<std::size_t>(i)]);
    if (!number || !std::isfinite(*number)) {
      refuse_row(file, row.number,
                 quoted(tokens[static_cast<std::size_t>(i)]) + " (number " + std::to_string(i + 1) +
                     ") is not a finite number; correct it");
    }
    pose(i / 4, i % 4) = *number;
  }
  return pose;
}

Eigen::Isometry3d parse_pose(const std::filesystem::path& file, const TextRow& row) {
  const Eigen::Matrix<double, 3, 4> numbers = parse_row(file, row);
  const Eigen::Matrix3d r = numbers.leftCols<3>();
  const double error = (r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= kMaxRotationError) || r.determinant() <= 0) {
    refuse_row(file, row.number, "the left 3x3 part is not a rotation; give camera-to-world poses [R | t], row-major");
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = svd.matrixU() * svd.matrixV().transpose();
  pose.translation() = numbers.col(3);
  return pose;
}

}  // namespace

std::vector<Isometry> read_poses(const std::filesystem::path& file) {
  const std::string text = read_file(file, kMaxPosesBytes);
  std::vector<TextRow> rows = split_rows(text, file);
  while (!rows.empty() && trim(rows.back().text).empty()) rows.pop_back();
  if (rows.empty()) throw InvalidArgument(file.string() + ": holds no poses; give a row of 12 numbers per frame");
  std::vector<Isometry> poses;
  poses.reserve(rows.size());
  for (const TextRow& row : rows) poses.push_back(parse_pose(file, row));
  return poses;
}

void write_poses(const std::filesystem::path& file, const std::vector<Isometry>& world_from_camera) {
  constexpr int kDecimals = 9;
  std::string text;
  for (const Isometry& pose : world_from_camera) {
    for (int i = 0; i < 12; ++i) {
      append_number(text, pose.matrix()(i / 4, i % 4), kDecimals);
      text += i < 11 ? ' ' : '\n';
    }
  }
  write_file(file, text);
}

}  // namespace egosgm::vision
