// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/point_cloud.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "egosgm/error.h"
#include "egosgm/image.h"
#include "egosgm/vision/image_io.h"
#include "tests/support/files.h"
#include "tests/vision/images.h"
#include "vision/file_io.h"

namespace egosgm::vision {
namespace {

constexpr float kNo = kInvalidDisparity;
const Calibration kCamera{.fx = 100, .fy = 50, .cx = 2, .cy = 1, .baseline_m = 0.5, .doffs_px = 5};

Image filled(float value, Size size = {6, 4}) { return Image(size, kF32, value); }
Image grey(Size size = {6, 4}) { return Image(size, kU8, 90); }

TEST(PointCloud, PutsPixelsWhereTheCameraSawThem) {
  const PointCloud cloud = point_cloud(filled(5), filled(0.01f), grey(), kCamera);
  ASSERT_EQ(cloud.points_m.size(), 24u);
  const std::array<float, 3> last = cloud.points_m.back();  // pixel (5, 3), shift 10 px: depth 5 m
  EXPECT_FLOAT_EQ(last[2], 5.0f);
  EXPECT_FLOAT_EQ(last[0], 0.15f);
  EXPECT_FLOAT_EQ(last[1], 0.2f);
  EXPECT_EQ(cloud.colors.back(), (Color{90, 90, 90}));
}

TEST(PointCloud, LeavesOutWhatIsUncertainFarInvalidOrAlone) {
  Image disparity = filled(5), variance = filled(0.01f);
  disparity.at<float>(0, 0) = kNo;
  disparity.at<float>(0, 2) = -5;    // d + doffs = 0
  disparity.at<float>(1, 4) = 9;     // no neighbour near
  variance.at<float>(3, 1) = 1.02f;  // sigma 1.01 px of 10 px: just above 10 %
  variance.at<float>(3, 3) = 0.98f;
  variance.at<float>(3, 5) = NAN;
  EXPECT_EQ(point_cloud(disparity, variance, grey(), kCamera).points_m.size(), 24u - 5u);
  const LeftOut left_out = point_cloud(disparity, variance, grey(), kCamera).left_out;
  EXPECT_EQ(left_out.far, 1);        // d + doffs = 0
  EXPECT_EQ(left_out.uncertain, 2);  // one above 10 %, one unknown
  EXPECT_EQ(left_out.alone, 1);
  EXPECT_EQ(left_out.reason, 0);
  EXPECT_EQ(point_cloud(disparity, variance, grey(), kCamera, {.max_depth_m = 4.9}).points_m.size(), 0u);
  EXPECT_EQ(point_cloud(disparity, variance, grey(), kCamera, {.max_jump_px = 4}).points_m.size(), 24u - 4u);
  disparity.at<float>(0, 3) = -6;  // d + doffs = -1
  const PointCloudOptions any{.max_relative_sigma = INFINITY, .max_depth_m = INFINITY, .max_jump_px = 100};
  EXPECT_EQ(point_cloud(disparity, variance, grey(), kCamera, any).left_out.far, 2);
}

TEST(PointCloud, KeepsPixelsOfTheReasonsThatWereChosen) {
  Image reasons(4, 6, kU8, static_cast<int>(Reason::kTrusted));
  reasons.at<std::uint8_t>(1, 2) = static_cast<std::uint8_t>(Reason::kFlat);
  reasons.at<std::uint8_t>(3, 0) = static_cast<std::uint8_t>(Reason::kPredicted);
  const auto cloud = [&](std::vector<Reason> kept) {
    return point_cloud(filled(5), filled(0.01f), grey(), kCamera, {.reasons = std::move(kept)}, reasons);
  };
  EXPECT_EQ(cloud({}).points_m.size(), 24u);
  EXPECT_EQ(cloud({Reason::kTrusted}).points_m.size(), 22u);
  EXPECT_EQ(cloud({Reason::kTrusted}).left_out.reason, 2);
  EXPECT_EQ(cloud({Reason::kTrusted, Reason::kPredicted}).points_m.size(), 23u);
  EXPECT_EQ(cloud({Reason::kFlat}).points_m.size(), 1u);
  EXPECT_THROW(point_cloud(filled(5), filled(1), grey(), kCamera, {.reasons = {Reason::kFlat}}), InvalidArgument);
}

TEST(PointCloud, RefusesWhatDoesNotBelongTogether) {
  EXPECT_THROW(point_cloud(filled(5), filled(1, {5, 4}), grey(), kCamera), InvalidArgument);
  EXPECT_THROW(point_cloud(filled(5), filled(1), grey({6, 5}), kCamera), InvalidArgument);
  EXPECT_THROW(point_cloud(grey(), filled(1), grey(), kCamera), InvalidArgument);
  EXPECT_THROW(point_cloud(filled(5), filled(1), grey(), {}), InvalidArgument);
  EXPECT_THROW(point_cloud(filled(5), filled(1), grey(), kCamera, {.max_relative_sigma = 0}), InvalidArgument);
  EXPECT_THROW(write_ply("cloud.ply", {.points_m = {{1, 2, 3}}, .colors = {{1, 2, 3}, {4, 5, 6}}}), InvalidArgument);
  EXPECT_THROW(write_ply("cloud.ply", {.points_m = {{1, 2, 3}}, .normals = {{1, 2, 3}, {4, 5, 6}}}), InvalidArgument);
}

TEST(PointCloud, PlyHoldsPointsAndColoursAsItsHeaderSays) {
  const TemporaryFolder folder;
  write_ply(folder / "cloud.ply", {.points_m = {{1, 2, 3}, {-4, 5.5f, 6}}, .colors = {{10, 20, 30}, {40, 50, 60}}});
  const std::string bytes = read_file(folder / "cloud.ply", 1 << 16);
  EXPECT_TRUE(bytes.starts_with("ply\nformat binary_little_endian 1.0\n"));
  EXPECT_NE(bytes.find("\nelement vertex 2\n"), std::string::npos);
  const std::size_t begin = bytes.find("end_header\n") + 11;
  ASSERT_EQ(bytes.size(), begin + 2 * 15);
  float xyz[3];
  std::memcpy(xyz, &bytes[begin + 15], sizeof xyz);
  EXPECT_EQ(xyz[0], -4.0f);
  EXPECT_EQ(xyz[1], 5.5f);
  EXPECT_EQ(xyz[2], 6.0f);
  EXPECT_EQ(static_cast<unsigned char>(bytes[begin + 12]), 30);  // red first
  EXPECT_EQ(static_cast<unsigned char>(bytes[begin + 14]), 10);
}

TEST(PointCloud, PlyHoldsNormalsWhereThereAreAny) {
  const TemporaryFolder folder;
  write_ply(folder / "plain.ply", {.points_m = {{1, 2, 3}}});
  const std::string plain = read_file(folder / "plain.ply", 1 << 16);
  EXPECT_EQ(plain.size(), plain.find("end_header\n") + 11 + 12);
  EXPECT_EQ(plain.find("red"), std::string::npos);
  write_ply(folder / "full.ply", {.points_m = {{1, 2, 3}}, .colors = {{10, 20, 30}}, .normals = {{0, 0.5f, -1}}});
  const std::string full = read_file(folder / "full.ply", 1 << 16);
  const std::size_t begin = full.find("end_header\n") + 11;
  ASSERT_EQ(full.size(), begin + 12 + 12 + 3);
  float normal[3];
  std::memcpy(normal, &full[begin + 12], sizeof normal);
  EXPECT_EQ(normal[1], 0.5f);
  EXPECT_EQ(normal[2], -1.0f);
  EXPECT_LT(full.find("property float nz"), full.find("property uchar red"));
  EXPECT_EQ(static_cast<unsigned char>(full[begin + 24]), 30);
}

TEST(PointCloud, DepthIsStoredInMillimetres) {
  const TemporaryFolder folder;
  const Image depth = map_from(1, {1.2344f, kNo, 65.535f, 65.536f, 0.0001f, 3e6f});
  EXPECT_EQ(write_depth_png(folder / "depth.png", depth), 2);
  const Image stored = read_stored_image(folder / "depth.png");
  ASSERT_EQ(stored.type, kU16);
  const std::vector<int> expected{1234, 0, 65535, 0, 1, 0};
  for (int x = 0; x < 6; ++x) EXPECT_EQ(stored.at<std::uint16_t>(0, x), expected[static_cast<std::size_t>(x)]) << x;
}

}  // namespace
}  // namespace egosgm::vision
