// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/poses_io.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/expect_refused.h"
#include "tests/support/files.h"
#include "tests/vision/data_folder.h"
#include "vision/file_io.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

const std::string kIdentity = "1 0 0 0 0 1 0 0 0 0 1 0\n";

TEST(PosesIo, RoundTrip) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> value(-3, 3);
  std::vector<Isometry> poses;
  for (int k = 0; k < 20; ++k) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(value(random), Eigen::Vector3d(value(random), value(random), 1).normalized())
                        .toRotationMatrix();
    pose.translation() = 100 * Eigen::Vector3d(value(random), value(random), value(random));
    poses.push_back(pose);
  }
  const TemporaryFolder folder;
  write_poses(folder / "poses.txt", poses);
  const auto read_back = read_poses(folder / "poses.txt");
  ASSERT_EQ(read_back.size(), poses.size());
  for (std::size_t k = 0; k < poses.size(); ++k) {
    EXPECT_LT((read_back[k].matrix() - poses[k].matrix()).cwiseAbs().maxCoeff(), 1e-6) << k;
    const Eigen::Matrix3d r = read_back[k].linear();
    EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-13) << k;
  }
}

TEST(PosesIo, RowMajorCameraToWorld) {
  const TemporaryFolder folder;
  // A turn to the right by 90 degrees: the camera's z axis is the world's x axis.
  write_file(folder / "poses.txt", kIdentity + "0 0 1 5  0 1 0 6\t-1 0 0 7\r\n\n");
  const auto poses = read_poses(folder / "poses.txt");
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_TRUE((poses[1] * Eigen::Vector3d(0, 0, 2)).isApprox(Eigen::Vector3d(7, 6, 7)));
  const Eigen::Isometry3d motion = current_from_previous(poses[0], poses[1]);
  EXPECT_TRUE((motion * Eigen::Vector3d(7, 6, 7)).isApprox(Eigen::Vector3d(0, 0, 2)));
}

TEST(PosesIo, BadRowsAreNamed) {
  const TemporaryFolder folder;
  const auto file = folder / "poses.txt";
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases = {
      {"", {"holds no poses"}},
      {"\n\n", {"holds no poses"}},
      {kIdentity + "1 2 3\n", {":2:", "this one has 3"}},
      {kIdentity + "\n" + kIdentity, {":2:", "this one has 0"}},
      {kIdentity + kIdentity + "1 0 0 0 0 1 0 0 0 0 1 0 0\n", {":3:", "this one has 13"}},
      {"# timestamp tx ty tz qx qy qz qw\n", {":1:", "it is a comment, as in TUM's files"}},
      {"0.1 1 2 3 0 0 0 1\n", {":1:", "this one has 8, as TUM's", "evo_traj tum"}},
      {"1 2 3 0 0 0 1\n", {":1:", "TartanAir's"}},
      {"1 0 0 0\n", {":1:", "first three rows"}},
      {"1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n", {":1:", "leave out each one's last four"}},
      {kIdentity + "1 0 0 x 0 1 0 0 0 0 1 0\n", {":2:", "'x' (number 4)"}},
      {"1 0 0 nan 0 1 0 0 0 0 1 0\n", {":1:", "'nan'"}},
      {"1 0 0 1e999 0 1 0 0 0 0 1 0\n", {":1:", "'1e999'"}},
      {"1e200 0 0 0 0 1 0 0 0 0 1 0\n", {":1:", "not a rotation"}},
      {"1.001 0 0 0 0 1 0 0 0 0 1 0\n", {":1:", "not a rotation"}},
      {"1 0 0 0 0 1 0 0 0 0 -1 0\n", {":1:", "not a rotation"}},
      {"0 0 0 0 0 0 0 0 0 0 0 0\n", {":1:", "not a rotation"}},
  };
  for (const auto& [text, parts] : cases) {
    write_file(file, text);
    for (const std::string& part : parts) expect_refused([&] { read_poses(file); }, {file.string(), part});
  }
  write_file(file, kIdentity + std::string(70000, ' ') + kIdentity);
  expect_refused([&] { read_poses(file); }, {"poses.txt:2:", "65536 bytes at most"});
  write_file(file, std::string(2'000'001, '\n'));
  expect_refused([&] { read_poses(file); }, {"poses.txt:2000001:", "2000000 rows at most"});
  expect_refused<IoError>([&] { write_poses(folder / "none/poses.txt", {}); }, {"none/poses.txt", "No such file"});
}

TEST(RealData, Poses) {
  EGOSGM_REQUIRE_DATA(data);
  const auto poses = read_poses(data / "odometry/sequences/A/poses.txt");
  ASSERT_EQ(poses.size(), 51u);
  const Eigen::Isometry3d motion = current_from_previous(poses[0], poses[1]);
  EXPECT_NEAR(motion.translation().z(), -1.199, 0.01);  // forward: points come nearer
}

}  // namespace
}  // namespace egosgm::vision
