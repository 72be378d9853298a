// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/rectification.h"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/calib3d.hpp>

#include "egosgm/error.h"
#include "egosgm/vision/synthetic.h"
#include "host/vision/file_io.h"
#include "tests/vision/temporary_folder.h"

namespace egosgm::vision {
namespace {

const cv::Size kSize(160, 120);
constexpr double kBaseline_m = 0.25;

cv::Mat rotation(double x, double y, double z) {
  cv::Mat R;
  cv::Rodrigues(cv::Vec3d(x, y, z), R);
  return R;
}

/// Turned and distorted cameras.
StereoRig rig(bool is_fisheye) {
  StereoRig rig;
  rig.is_fisheye = is_fisheye;
  rig.left.matrix = (cv::Mat_<double>(3, 3) << 150, 0, 82, 0, 148, 59, 0, 0, 1);
  rig.right.matrix = (cv::Mat_<double>(3, 3) << 146, 0, 77, 0, 149, 61, 0, 0, 1);
  if (is_fisheye) {
    rig.left.distortion = (cv::Mat_<double>(4, 1) << 0.06, -0.02, 0.004, -0.001);
    rig.right.distortion = (cv::Mat_<double>(4, 1) << 0.05, -0.015, 0.003, -0.0008);
  } else {
    rig.left.distortion = (cv::Mat_<double>(5, 1) << -0.12, 0.03, 0.001, -0.0005, 0);
    rig.right.distortion = (cv::Mat_<double>(5, 1) << -0.1, 0.02, -0.0008, 0.0006, 0);
  }
  rig.R = rotation(0.02, -0.015, 0.01);
  rig.T = (cv::Mat_<double>(3, 1) << -kBaseline_m, 0.004, -0.006);
  return rig;
}

/// The direction from which a raw camera sees its pixel.
cv::Vec3d ray(const StereoRig& rig, const StereoRig::Camera& camera, const cv::Mat (&map)[2], int x, int y) {
  const std::vector<cv::Point2d> raw{{map[0].at<float>(y, x), map[1].at<float>(y, x)}};
  std::vector<cv::Point2d> plain;
  if (rig.is_fisheye) {
    cv::fisheye::undistortPoints(raw, plain, camera.matrix, camera.distortion);
  } else {
    cv::undistortPoints(raw, plain, camera.matrix, camera.distortion);
  }
  return {plain[0].x, plain[0].y, 1};
}

class RectificationOfModel : public testing::TestWithParam<bool> {};

/// Pixels of one rectified row are triangulated by the raw cameras: the rays meet, at the depth of the disparity.
TEST_P(RectificationOfModel, RaysOfARowMeetAtTheDepthOfTheDisparity) {
  const StereoRig cameras = rig(GetParam());
  const Rectification result = rectification_of(cameras, kSize);
  EXPECT_NEAR(result.calibration.baseline_m, cv::norm(cameras.T), 1e-9);
  EXPECT_NEAR(result.calibration.doffs_px, 0, 1e-9);
  const cv::Matx33d R(cameras.R);
  const cv::Vec3d T(cameras.T);
  for (int y = 20; y < kSize.height - 20; y += 13) {
    for (int x = 40; x < kSize.width - 20; x += 17) {
      for (const int disparity : {4, 15}) {
        const cv::Vec3d left = R * ray(cameras, cameras.left, result.left_map, x, y);
        const cv::Vec3d right = ray(cameras, cameras.right, result.right_map, x - disparity, y);
        // a * left + T = b * right
        cv::Vec2d ab;
        const cv::Matx32d both(left[0], -right[0], left[1], -right[1], left[2], -right[2]);
        ASSERT_TRUE(cv::solve(both, -T, ab, cv::DECOMP_SVD));
        const cv::Vec3d gap = ab[0] * left + T - ab[1] * right;
        EXPECT_LT(cv::norm(gap), 1e-3 * ab[0]) << x << " " << y << " " << disparity;
        const Calibration& c = result.calibration;
        const double depth_m = c.fx * c.baseline_m / disparity;
        const double distance_m = depth_m * cv::norm(cv::Vec3d((x - c.cx) / c.fx, (y - c.cy) / c.fy, 1));
        EXPECT_NEAR(ab[0] * cv::norm(left), distance_m, 0.01 * distance_m) << x << " " << y << " " << disparity;
      }
    }
  }
}

TEST_P(RectificationOfModel, ValidIsWhatTheRawImageHas) {
  const Rectification tight = rectification_of(rig(GetParam()), kSize, 0);
  EXPECT_EQ(tight.valid.size(), kSize);
  EXPECT_EQ(cv::countNonZero(tight.valid(tight.valid_left)), tight.valid_left.area());
  EXPECT_GT(tight.valid_left.area(), kSize.area() / 2);
  EXPECT_GT(tight.valid_right.area(), kSize.area() / 2);
  const cv::Mat white(kSize, CV_16UC1, cv::Scalar(60000));
  const cv::Mat rectified = rectify(white, tight.left_map);
  EXPECT_EQ(rectified.type(), CV_16UC1);
  EXPECT_EQ(cv::countNonZero(rectified(tight.valid_left) != 60000), 0);
}

INSTANTIATE_TEST_SUITE_P(Models, RectificationOfModel, testing::Bool(),
                         [](const auto& model) { return model.param ? "Fisheye" : "Lens"; });

TEST(Rectification, OfRectifiedCamerasChangesNothing) {
  StereoRig cameras;
  cameras.left.matrix = (cv::Mat_<double>(3, 3) << 150, 0, 79.5, 0, 150, 59.5, 0, 0, 1);
  cameras.right.matrix = cameras.left.matrix.clone();
  cameras.left.distortion = cameras.right.distortion = cv::Mat::zeros(4, 1, CV_64F);
  cameras.R = cv::Mat::eye(3, 3, CV_64F);
  cameras.T = (cv::Mat_<double>(3, 1) << -kBaseline_m, 0, 0);
  const cv::Mat projection = (cv::Mat_<double>(3, 4) << 150, 0, 79.5, 0, 0, 150, 59.5, 0, 0, 0, 1, 0);
  cv::Mat right_projection = projection.clone();
  right_projection.at<double>(0, 3) = -150 * kBaseline_m;
  cameras.given[0] = cameras.given[1] = cameras.R;
  cameras.given[2] = projection;
  cameras.given[3] = right_projection;
  const Rectification result = rectification_of(cameras, kSize);
  EXPECT_DOUBLE_EQ(result.calibration.fx, 150);
  EXPECT_DOUBLE_EQ(result.calibration.cx, 79.5);
  EXPECT_DOUBLE_EQ(result.calibration.baseline_m, kBaseline_m);
  cv::Mat image(kSize, CV_8UC1);
  cv::randu(image, 0, 256);
  EXPECT_EQ(cv::norm(rectify(image, result.right_map), image, cv::NORM_INF), 0);
  EXPECT_EQ(result.valid_left, cv::Rect({}, kSize));
}

void expect_refused(const std::function<void()>& call, const std::string& named) {
  try {
    call();
    FAIL() << "not refused: " << named;
  } catch (const InvalidArgument& error) {
    EXPECT_NE(std::string(error.what()).find(named), std::string::npos) << error.what();
  }
}

TEST(Rectification, RefusesWhatIsNoRig) {
  const auto refused = [](const std::string& named, const std::function<void(StereoRig&)>& spoil) {
    StereoRig cameras = rig(false);
    spoil(cameras);
    expect_refused([&] { rectification_of(cameras, kSize); }, named);
  };
  refused("exchange left and right", [](StereoRig& r) { r.T = -r.T; });
  refused("unit_m 0.001", [](StereoRig& r) { r.T = 1000 * r.T; });
  refused("side by side", [](StereoRig& r) { cv::swap(r.T.at<double>(0), r.T.at<double>(1)); });
  refused("R is no rotation", [](StereoRig& r) { r.R = 2 * r.R; });
  refused("320x240 were calibrated", [](StereoRig& r) { r.size = cv::Size(320, 240); });
  refused("M2: needs 3x3", [](StereoRig& r) { r.right.matrix = cv::Mat(); });
  refused("M1: needs 3x3", [](StereoRig& r) { r.left.matrix.convertTo(r.left.matrix, CV_32F); });
  refused("D1: needs 4", [](StereoRig& r) { r.left.distortion = cv::Mat::zeros(3, 1, CV_64F); });
  refused("T: needs 3x1", [](StereoRig& r) { r.T = r.T.t(); });
  refused("R: needs 3x3", [](StereoRig& r) { r.R.at<double>(1, 1) = std::nan(""); });
  refused("belong together", [](StereoRig& r) { r.given[1] = r.R; });
  expect_refused([] { rectification_of(rig(false), kSize, 1.5); }, "alpha 1.5");
  expect_refused([] { rectification_of(rig(false), {0, 5}); }, "size 0x5");
  const Rectification sound = rectification_of(rig(false), kSize);
  expect_refused([&] { rectify(cv::Mat::zeros(3, 7, CV_8UC1), sound.left_map); }, "an image is 7x3");
}

TEST(RigFiles, OpenCvsNamesAndUnits) {
  const TemporaryFolder folder;
  const StereoRig cameras = rig(false);
  const auto write = [&](const char* name, bool whole) {
    cv::FileStorage file((folder / name).string(), cv::FileStorage::WRITE);
    file << "K1" << cameras.left.matrix << "D1" << cameras.left.distortion << "D2" << cameras.right.distortion;
    if (whole) file << "K2" << cameras.right.matrix;
    file << "R" << cameras.R << "T" << cv::Mat(1000 * cameras.T) << "image_width" << 160 << "image_height" << 120;
  };
  for (const char* name : {"rig.yml", "rig.xml", "rig.json"}) {
    write(name, true);
    const std::optional<StereoRig> read = read_opencv_rig(folder / name, 1e-3);
    ASSERT_TRUE(read) << name;
    EXPECT_LT(cv::norm(read->right.matrix, cameras.right.matrix), 1e-9);
    EXPECT_LT(cv::norm(read->left.distortion, cameras.left.distortion), 1e-12);
    EXPECT_LT(cv::norm(read->T, cameras.T), 1e-9);
    EXPECT_EQ(read->size, kSize);
    EXPECT_FALSE(read->given[0]);
    EXPECT_FALSE(rectification_of(*read, kSize).valid.empty());
  }
  write("half.yml", false);
  expect_refused([&] { read_opencv_rig(folder / "half.yml"); }, "has no M2");
  expect_refused([&] { read_opencv_rig(folder / "rig.yml", 1, true); }, "fisheye model has 4");
  write_file(folder / "kitti.txt", std::string("P0: 1 0 0 0 0 1 0 0 0 0 1 0\n"));
  EXPECT_FALSE(read_opencv_rig(folder / "kitti.txt"));
  expect_refused([&] { read_opencv_rig(folder / "nothing.yml"); }, "nothing.yml");
  expect_refused([&] { read_euroc_rig(folder / "mav0"); }, "sensor.yaml");
}

TEST(RigFiles, NestingHasABound) {
  const TemporaryFolder folder;
  const auto many = [](const std::string& text) {
    std::string all;
    for (int i = 0; i < 100000; ++i) all += text;
    return all;
  };
  const std::string yaml = "%YAML:1.0\n---\nM1: ", json = "{\"M1\":", xml = "<?xml version=\"1.0\"?>\n<opencv_storage>";
  for (const std::string& text :
       {yaml + many("["), yaml + many("{data: "), yaml + many("a: "), yaml + many("- "), yaml + many("-\t"),
        json + many("["), json + many("{\"data\":"), xml + many("<a>"), xml + many("<a b=\"1\">")}) {
    write_file(folder / "nested.yml", text);
    expect_refused([&] { read_opencv_rig(folder / "nested.yml"); }, "nested or named parts");
  }
}

TEST(PairMatches, LieInTheRowsOfRectifiedImages) {
  const SyntheticSequence street({.frames = 1, .width = 320, .height = 128, .seed = 5});
  const SyntheticFrame frame = street.render(0);
  const std::vector<PairMatch> matches = match_pair(frame.left, frame.right);
  ASSERT_GT(matches.size(), 50u);
  std::size_t in_row = 0;
  for (const PairMatch& match : matches) in_row += std::abs(match.left.y - match.right.y) < 0.5;
  EXPECT_GT(in_row, matches.size() * 9 / 10);
  EXPECT_TRUE(match_pair(cv::Mat::zeros(128, 320, CV_8UC1), frame.right).empty());
  expect_refused([&] { match_pair(frame.left, frame.right.colRange(0, 300)); }, "one size");
}

}  // namespace
}  // namespace egosgm::vision
