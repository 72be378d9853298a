// SPDX-License-Identifier: Apache-2.0
// The motion of matches that are given, and what they tell of the rectification.
#include "host/odometry/motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "egosgm/odometry.h"
#include "host/odometry/rectification.h"
#include "tests/odometry/motions.h"

namespace egosgm {
namespace {

using odometry::PointMatch;

// A point anywhere in a 1226x370 image, 4 to 80 m ahead.
PointMatch random_match(std::mt19937& generator, const Calibration& calibration, const Eigen::Isometry3d& motion,
                        double noise_px) {
  std::uniform_real_distribution<double> u(0, 1226), v(0, 370), inverse_depth(1.0 / 80, 1.0 / 4);
  std::normal_distribution<double> noise(0, 1);
  PointMatch match{};
  match.u1 = u(generator);
  match.v1 = v(generator);
  match.d1 = calibration.fx * calibration.baseline_m * inverse_depth(generator);
  const Eigen::Vector3d p = motion * odometry::triangulate(calibration, match.u1, match.v1, match.d1);
  const Eigen::Vector3d q = odometry::project(calibration, p);
  match.d1 += noise_px * noise(generator);
  match.u2 = q.x() + noise_px * noise(generator);
  match.v2 = q.y() + noise_px * noise(generator);
  match.d2 = q.z() + noise_px * noise(generator);
  return match;
}

std::vector<PointMatch> random_matches(std::mt19937& generator, const Calibration& calibration,
                                       const Eigen::Isometry3d& motion, int count, double noise_px) {
  std::vector<PointMatch> matches;
  for (int i = 0; i < count; ++i) matches.push_back(random_match(generator, calibration, motion, noise_px));
  return matches;
}

odometry::MotionEstimate estimate(const Calibration& calibration, const std::vector<PointMatch>& matches,
                                  const StereoOdometryOptions& options = {}) {
  const auto rough = odometry::estimate_motion(calibration, options, matches, Eigen::Isometry3d::Identity(), 2.5);
  if (!rough.reason.empty()) return rough;
  return odometry::refine_motion(calibration, options, {}, matches, rough.motion.current_from_previous);
}

TEST(OdometryMotion, RecoversExactMotion) {
  std::mt19937 generator(1);
  const Calibration calibration = kitti_calibration();
  for (const Eigen::Isometry3d& truth : {make_motion(0, 0, 0, 0), make_motion(0.05, -0.02, -1.2, 2.7, 0.3),
                                         make_motion(-0.1, 0.01, -2.5, -2.7), make_motion(0.1, 0, 1.0, 8)}) {
    const auto result = estimate(calibration, random_matches(generator, calibration, truth, 200, 0));
    ASSERT_EQ(result.reason, "");
    const MotionError error = motion_error(result.motion.current_from_previous, truth);
    EXPECT_LT(error.translation_m, 1e-8);
    EXPECT_LT(error.rotation_deg, 1e-7);
  }
}

TEST(OdometryMotion, HalfAStepTwiceIsAStep) {
  odometry::Vector6 step;
  step << 0.4, -0.2, 1.1, 0.3, -0.5, 0.2;
  const Eigen::Isometry3d start = make_motion(0.05, -0.02, -1.2, 2.7, 0.3);
  const Eigen::Isometry3d once = odometry::perturb(step, start),
                          twice = odometry::perturb(step / 2, odometry::perturb(step / 2, start));
  EXPECT_LT((once.matrix() - twice.matrix()).norm(), 1e-12);
}

TEST(OdometryMotion, RecoversMotionFromNoiseAndOutliers) {
  std::mt19937 generator(2);
  const Calibration calibration = kitti_calibration();
  const Eigen::Isometry3d truth = make_motion(0.02, -0.01, -1.2, 2.7), other = make_motion(0.9, 0, 0.4, -5);
  std::uniform_real_distribution<double> wrong(-40, 40);
  auto matches = random_matches(generator, calibration, truth, 300, 0.2);
  for (int i = 0; i < 100; ++i) {
    PointMatch match = random_match(generator, calibration, other, 0.2);
    match.u2 += wrong(generator);
    match.v2 += wrong(generator);
    matches.push_back(match);
  }
  const auto result = estimate(calibration, matches);
  ASSERT_EQ(result.reason, "");
  const MotionError error = motion_error(result.motion.current_from_previous, truth);
  EXPECT_LT(error.translation_m, 0.006);
  EXPECT_LT(error.rotation_deg, 0.02);
  EXPECT_GT(result.inliers.size(), 260u);
  EXPECT_LT(std::count_if(result.inliers.begin(), result.inliers.end(), [](int i) { return i >= 300; }), 10);
}

// Three of five matches are on a vehicle, which fills two fifths of the image.
TEST(OdometryMotion, DenseMovingObjectDoesNotWin) {
  std::mt19937 generator(3);
  const Calibration calibration = kitti_calibration();
  const Eigen::Isometry3d truth = make_motion(0, 0, -1.0, 0.5), object = make_motion(0.6, 0, -0.3, 0.5);
  std::vector<PointMatch> matches;
  while (matches.size() < 360) {
    const PointMatch match = random_match(generator, calibration, object, 0.15);
    if (match.u1 > 380 && match.u1 < 870) matches.push_back(match);
  }
  while (matches.size() < 600) {
    const PointMatch match = random_match(generator, calibration, truth, 0.15);
    if (match.u1 < 380 || match.u1 > 870) matches.push_back(match);
  }
  const auto result = estimate(calibration, matches, {.min_inlier_ratio = 0.2});
  ASSERT_EQ(result.reason, "");
  EXPECT_LT(motion_error(result.motion.current_from_previous, truth).translation_m, 0.02);
}

TEST(OdometryMotion, SaysWhyThereIsNone) {
  std::mt19937 generator(4);
  const Calibration calibration = kitti_calibration();
  const auto few = random_matches(generator, calibration, make_motion(0, 0, -1, 0), 8, 0);
  EXPECT_NE(estimate(calibration, few).reason.find("too few matches"), std::string::npos);

  const StereoOdometryOptions slow{.max_translation_m = 0.5};
  const auto fast = random_matches(generator, calibration, make_motion(0, 0, -1, 0), 200, 0);
  EXPECT_NE(estimate(calibration, fast, slow).reason, "");
  const auto refined = odometry::refine_motion(calibration, slow, {}, fast, make_motion(0, 0, -1, 0));
  EXPECT_NE(refined.reason.find("exceeds the bound of 0.50 m"), std::string::npos) << refined.reason;
  EXPECT_NE(odometry::out_of_bounds(slow, make_motion(0, 0, -1, 0)).find("translation of 1.00 m"), std::string::npos);
  EXPECT_NE(odometry::out_of_bounds({}, make_motion(0, 0, -1, 20)).find("rotation of 20.00 deg"), std::string::npos);
  EXPECT_EQ(odometry::out_of_bounds({}, make_motion(0, 0, -1, 10)), "");

  std::vector<PointMatch> unrelated;
  for (int i = 0; i < 200; ++i) {
    const PointMatch first = random_match(generator, calibration, make_motion(0, 0, -1, 0), 0);
    const PointMatch second = random_match(generator, calibration, make_motion(0, 0, -1, 0), 0);
    unrelated.push_back({first.u1, first.v1, first.d1, second.u2, second.v2, second.d2});
  }
  EXPECT_NE(estimate(calibration, unrelated).reason, "");

  // Far points agree with the motion that they are taken for; all near ones contradict it.
  auto halves = random_matches(generator, calibration, make_motion(0, 0, -1, 0), 240, 0);
  const auto near = random_matches(generator, calibration, make_motion(0, 0, -6, 0), 200, 0);
  halves.insert(halves.end(), near.begin(), near.end());
  const auto half = odometry::refine_motion(calibration, {}, {}, halves, make_motion(0, 0, -1, 0));
  EXPECT_EQ(half.reason.find("inlier ratio 0.5"), 0u) << half.reason;
}

// A projector's dots stay where they are in the images, and only their disparities tell that the camera came nearer.
TEST(OdometryMotion, RefusesFeaturesThatMoveWithTheCamera) {
  std::mt19937 generator(7);
  std::normal_distribution<double> noise(0, 0.1);
  const Calibration calibration = kitti_calibration();
  for (const double growth : {1.03, 0.97}) {
    std::vector<PointMatch> dots = random_matches(generator, calibration, make_motion(0, 0, 0, 0), 300, 0.1);
    for (PointMatch& dot : dots) dot.d2 = growth * dot.d1 + noise(generator);
    const auto result = odometry::refine_motion(calibration, {}, {}, dots, Eigen::Isometry3d::Identity());
    EXPECT_NE(result.reason.find("a projector's dots do, or doffs_px is wrong"), std::string::npos) << result.reason;
    EXPECT_NE(result.reason.find(growth > 1 ? "+" : "-"), std::string::npos) << result.reason;
  }
}

// Large images have larger errors: half a pixel is little where the motion explains two.
TEST(OdometryMotion, TakesErrorsOfDisparitiesThatAreSmallBesideTheirChange) {
  std::mt19937 generator(7);
  const Calibration calibration = kitti_calibration();
  const auto reason = [&](double forward_m, double error_px) {
    const Eigen::Isometry3d truth = make_motion(0, 0, -forward_m, 0);
    std::vector<PointMatch> matches = random_matches(generator, calibration, truth, 300, 0.1);
    for (PointMatch& match : matches) match.d2 += error_px;
    return odometry::refine_motion(calibration, {}, {}, matches, truth).reason;
  };
  for (const double error_px : {0.5, -0.5}) {
    EXPECT_EQ(reason(1.2, error_px), "");
    EXPECT_NE(reason(0.05, error_px), "");
  }
}

// The pair's error grows with x^2 and x y; each frame sees new points.
TEST(OdometryRectification, LearnsYawAndDistortionButNothingFromAnExactPair) {
  const Calibration c = kitti_calibration();
  const Eigen::Isometry3d truth = make_motion(0, 0, -1.2, 0);
  const auto run = [&](double yaw_px, double distortion_px) {
    std::mt19937 generator(6);
    std::normal_distribution<double> noise(0, 0.1);
    odometry::RectificationError rectification;
    double last_error_m = 0;
    for (int frame = 0; frame < 25; ++frame) {
      auto matches = random_matches(generator, c, truth, 300, 0.15);
      for (PointMatch& m : matches) {
        const auto disparity = [&](double u, double v) {
          const double x = (u - c.cx) / c.fx, y = (v - c.cy) / c.fy;
          return -yaw_px * x * x - distortion_px * (3 * x * x + y * y);
        };
        const double x = (m.u2 - c.cx) / c.fx, y = (m.v2 - c.cy) / c.fy;
        m.d1 += disparity(m.u1, m.v1);
        m.d2 += disparity(m.u2, m.v2);
        m.row_error2 = (yaw_px + 2 * distortion_px) * x * y + noise(generator);
      }
      rectification.correct(c, matches);
      const auto fine = odometry::refine_motion(c, {}, {}, matches, truth);
      EXPECT_EQ(fine.reason, "");
      rectification.update(c, {}, matches, fine.inliers, fine.motion.current_from_previous);
      last_error_m = motion_error(fine.motion.current_from_previous, truth).translation_m;
    }
    EXPECT_NEAR(rectification.row_px(c, c.cx + 500, c.cy + 150), (yaw_px + 2 * distortion_px) * 500 / c.fx * 150 / c.fy,
                0.05);
    const double x = 500 / c.fx;
    EXPECT_NEAR(rectification.disparity_px(c, c.cx + 500, c.cy) - rectification.disparity_px(c, c.cx, c.cy),
                -(yaw_px + 3 * distortion_px) * x * x, 0.1);
    EXPECT_LT(last_error_m, 0.01);
  };
  run(12, -3);
  run(0, 0);
}

// Half a pixel between the rows, and roll (which moves disparities above and below the centre): such a pair's lenses
// are as good as any other's.
TEST(OdometryRectification, OffsetAndRollOfTheRowsTellNothingOfTheDisparity) {
  const Calibration c = kitti_calibration();
  const Eigen::Isometry3d truth = make_motion(0, 0, -1.2, 1);
  std::mt19937 generator(7);
  std::normal_distribution<double> noise(0, 0.1);
  odometry::RectificationError rectification;
  for (int frame = 0; frame < 25; ++frame) {
    auto matches = random_matches(generator, c, truth, 300, 0.15);
    for (PointMatch& m : matches) m.row_error2 = 0.5 - 0.6 * (m.u2 - c.cx) / c.fx + noise(generator);
    rectification.correct(c, matches);
    const auto fine = odometry::refine_motion(c, {}, {}, matches, truth);
    ASSERT_EQ(fine.reason, "");
    EXPECT_LT(motion_error(fine.motion.current_from_previous, truth).translation_m, 0.008) << "frame " << frame;
    rectification.update(c, {}, matches, fine.inliers, fine.motion.current_from_previous);
    for (const double u : {0.0, 600.0, 1225.0}) EXPECT_NEAR(rectification.disparity_px(c, u, c.cy), 0, 0.03);
  }
  EXPECT_NEAR(rectification.row_px(c, c.cx, c.cy), 0.5, 0.03);
  EXPECT_NEAR(rectification.row_px(c, c.cx + c.fx, c.cy), -0.1, 0.05);
}

}  // namespace
}  // namespace egosgm
