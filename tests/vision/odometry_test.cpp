// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/odometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <random>
#include <thread>
#include <vector>

#include "egosgm/vision/calibration_io.h"
#include "egosgm/vision/image_io.h"
#include "egosgm/vision/poses_io.h"
#include "egosgm/vision/synthetic.h"
#include "host/vision/odometry_features.h"
#include "host/vision/odometry_matching.h"
#include "host/vision/odometry_motion.h"
#include "host/vision/odometry_rectification.h"
#include "host/vision/odometry_subpixel.h"
#include "tests/vision/data_folder.h"
#include "tests/vision/expect_refused.h"

namespace egosgm::vision {
namespace {

using odometry::PointMatch;

constexpr double kDegree = 3.14159265358979323846 / 180;

Calibration kitti_calibration() { return {707, 707, 602, 183, 0.537, 0}; }

Eigen::Isometry3d make_motion(double x_m, double y_m, double z_m, double yaw_deg, double pitch_deg = 0) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = (Eigen::AngleAxisd(yaw_deg * kDegree, Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(pitch_deg * kDegree, Eigen::Vector3d::UnitX()))
                        .toRotationMatrix();
  motion.translation() = Eigen::Vector3d(x_m, y_m, z_m);
  return motion;
}

struct MotionError {
  double translation_m, rotation_deg;
};

MotionError motion_error(const Eigen::Isometry3d& estimate, const Eigen::Isometry3d& truth) {
  const Eigen::Isometry3d error = estimate * truth.inverse();
  return {error.translation().norm(), Eigen::AngleAxisd(error.linear()).angle() / kDegree};
}

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

odometry::GreyImage random_image(std::mt19937& generator, int width, int height) {
  std::uniform_int_distribution<int> grey(0, 255);
  odometry::GreyImage image;
  image.width = width;
  image.height = height;
  image.pixels.resize(static_cast<std::size_t>(width) * height);
  for (auto& pixel : image.pixels) pixel = static_cast<std::uint8_t>(grey(generator));
  return image;
}

int filter_response(const odometry::GreyImage& image, int x, int y, bool corner) {
  static const int kBlob[5][5] = {
      {-1, -1, -1, -1, -1}, {-1, 1, 1, 1, -1}, {-1, 1, 8, 1, -1}, {-1, 1, 1, 1, -1}, {-1, -1, -1, -1, -1}};
  static const int kCorner[5][5] = {
      {1, 1, 0, -1, -1}, {1, 1, 0, -1, -1}, {0, 0, 0, 0, 0}, {-1, -1, 0, 1, 1}, {-1, -1, 0, 1, 1}};
  int sum = 0;
  for (int i = -2; i <= 2; ++i) {
    for (int j = -2; j <= 2; ++j) sum += (corner ? kCorner : kBlob)[i + 2][j + 2] * image.row(y + i)[x + j];
  }
  return sum;
}

TEST(OdometryFeatures, EqualsFiltersAndSuppressionAsWrittenInThePaper) {
  std::mt19937 generator(11);
  const odometry::GreyImage image = random_image(generator, 101, 67);
  odometry::FeatureDetector detector;
  odometry::FeatureSet set;
  detector.detect(image, 300, 1 << 20, set);
  int expected = 0;
  for (int c = 0; c < odometry::kFeatureClasses; ++c) {
    const int sign = c % 2 == 0 ? 1 : -1;
    for (int y = 9; y < image.height - 9; ++y) {
      int k = set.first_of_row(c, y);
      for (int x = 9; x < image.width - 9; ++x) {
        const int response = sign * filter_response(image, x, y, c >= 2);
        bool largest = response >= 300;
        for (int i = -3; i <= 3 && largest; ++i) {
          for (int j = -3; j <= 3; ++j) {
            if (sign * filter_response(image, x + j, y + i, c >= 2) > response) largest = false;
          }
        }
        if (!largest) continue;
        ++expected;
        ASSERT_LT(k, set.first_of_row(c, y + 1)) << "class " << c << ": no feature at " << x << ", " << y;
        EXPECT_EQ(set.features[k].x, x) << "class " << c << ", row " << y;
        EXPECT_EQ(set.features[k].y, y);
        EXPECT_EQ(set.features[k].strength, response);
        ++k;
      }
      ASSERT_EQ(k, set.first_of_row(c, y + 1)) << "class " << c << ", row " << y;
    }
  }
  EXPECT_EQ(set.size(), expected);
  EXPECT_GT(expected, 100);
}

TEST(OdometryFeatures, DescriptorsDoNotDependOnBrightnessAndContrast) {
  std::mt19937 generator(12);
  odometry::GreyImage image = random_image(generator, 60, 60), dimmed = image;
  for (auto& pixel : dimmed.pixels) pixel = static_cast<std::uint8_t>(20 + pixel * 6 / 10);
  odometry::FeatureDetector detector;
  odometry::FeatureSet bright, dark;
  detector.detect(image, 600, 1 << 20, bright);
  detector.detect(dimmed, 200, 1 << 20, dark);
  int common = 0;
  for (int i = 0; i < bright.size(); ++i) {
    for (int j = 0; j < dark.size(); ++j) {
      if (bright.features[i].x != dark.features[j].x || bright.features[i].y != dark.features[j].y) continue;
      ++common;
      EXPECT_LT(odometry::descriptor_distance(bright.descriptors[i], dark.descriptors[j]),
                4 * odometry::kDescriptorSize);
    }
  }
  EXPECT_GT(common, 20);
}

// A sum of waves, smooth and without period in the patch.
double texture(double x, double y) {
  return 128 + 40 * std::sin(0.7 * x + 0.2 * y) + 35 * std::sin(0.55 * y - 0.3 * x + 1) +
         20 * std::sin(0.9 * x + 0.8 * y);
}

TEST(OdometrySubpixel, FindsShiftUnderExposureChange) {
  odometry::GreyImage first, second;
  for (auto* image : {&first, &second}) {
    image->width = image->height = 64;
    image->pixels.resize(64 * 64);
  }
  const double shift_x = 1.37, shift_y = -0.61;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      first.row(y)[x] = static_cast<std::uint8_t>(std::lround(texture(x, y)));
      second.row(y)[x] = static_cast<std::uint8_t>(std::lround(30 + 0.6 * texture(x - shift_x, y - shift_y)));
    }
  }
  odometry::Patch patch;
  ASSERT_TRUE(odometry::make_patch(first, 30, 31, 1.0f, patch));
  float x = 30, y = 31;
  ASSERT_TRUE(odometry::align_patch(patch, second, 0.9f, x, y));
  EXPECT_NEAR(x, 30 + shift_x, 0.02);
  EXPECT_NEAR(y, 31 + shift_y, 0.02);
}

TEST(OdometrySubpixel, RefusesFlatPatchAndFarMove) {
  odometry::GreyImage flat;
  flat.width = flat.height = 40;
  flat.pixels.assign(1600, 90);
  odometry::Patch patch;
  EXPECT_FALSE(odometry::make_patch(flat, 20, 20, 1.0f, patch));
  odometry::GreyImage edge = flat;  // a straight edge fixes no position along itself
  for (int y = 0; y < 40; ++y) std::fill(edge.row(y) + 20, edge.row(y) + 40, std::uint8_t{200});
  EXPECT_FALSE(odometry::make_patch(edge, 20, 20, 1.0f, patch));
}

// One image's features, all of class 0, in the order of their rows.
odometry::FeatureSet feature_set(const std::vector<odometry::Feature>& features,
                                 const std::vector<odometry::Descriptor>& descriptors, int height) {
  odometry::FeatureSet set;
  set.height = height;
  set.features = features;
  set.descriptors = descriptors;
  set.classes.assign(features.size(), 0);
  set.row_begin.assign(odometry::kFeatureClasses * (height + 1), static_cast<int>(features.size()));
  for (int y = 0; y <= height; ++y) {
    set.row_begin[y] = static_cast<int>(
        std::count_if(features.begin(), features.end(), [y](const odometry::Feature& f) { return f.y < y; }));
  }
  return set;
}

// The last leg leads to another feature of the previous right image when that one looks more alike.
TEST(OdometryMatching, KeepsClosedCirclesOnly) {
  odometry::Descriptor grey, brighter;
  grey.fill(100);
  brighter.fill(108);
  for (const bool closes : {true, false}) {
    odometry::TrackedFrame previous, current;
    for (auto* frame : {&previous, &current}) {
      for (auto* image : {&frame->left, &frame->right}) {
        image->width = 200;
        image->height = 60;
      }
    }
    previous.left_features = feature_set({{100, 30, 50}}, {grey}, 60);
    previous.right_features = feature_set({{90, 30, 50}, {93, 33, 50}}, {grey, closes ? grey : brighter}, 60);
    current.left_features = feature_set({{104, 31, 50}}, {grey}, 60);
    current.right_features = feature_set({{94, 31, 50}}, {brighter}, 60);
    previous.reset_matches();
    current.reset_matches();
    const auto matches = odometry::match_circle(kitti_calibration(), previous, current, {0}, nullptr, {20, 10}, 60);
    ASSERT_EQ(matches.size(), closes ? 1u : 0u);
    if (closes) {
      EXPECT_EQ(matches[0].previous_right, 0);
    }
  }
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
  StereoOdometryOptions options;
  options.min_inlier_ratio = 0.2;
  const auto result = estimate(calibration, matches, options);
  ASSERT_EQ(result.reason, "");
  EXPECT_LT(motion_error(result.motion.current_from_previous, truth).translation_m, 0.02);
}

TEST(OdometryMotion, SaysWhyThereIsNone) {
  std::mt19937 generator(4);
  const Calibration calibration = kitti_calibration();
  const auto few = random_matches(generator, calibration, make_motion(0, 0, -1, 0), 8, 0);
  EXPECT_NE(estimate(calibration, few).reason.find("too few matches"), std::string::npos);

  StereoOdometryOptions slow;
  slow.max_translation_m = 0.5;
  const auto fast = random_matches(generator, calibration, make_motion(0, 0, -1, 0), 200, 0);
  EXPECT_NE(estimate(calibration, fast, slow).reason, "");
  const auto refined = odometry::refine_motion(calibration, slow, {}, fast, make_motion(0, 0, -1, 0));
  EXPECT_NE(refined.reason.find("exceeds the bound of 0.50 m"), std::string::npos) << refined.reason;
  EXPECT_NE(odometry::out_of_bounds(slow, make_motion(0, 0, -1, 0)).find("translation of 1.00 m"), std::string::npos);
  EXPECT_NE(odometry::out_of_bounds({}, make_motion(0, 0, -1, 20)).find("rotation of 20.00 deg"), std::string::npos);
  EXPECT_EQ(odometry::out_of_bounds({}, make_motion(0, 0, -1, 10)), "");

  std::vector<PointMatch> unrelated;
  for (int i = 0; i < 200; ++i) {
    PointMatch match = random_match(generator, calibration, make_motion(0, 0, -1, 0), 0);
    const PointMatch second = random_match(generator, calibration, make_motion(0, 0, -1, 0), 0);
    match.u2 = second.u2;
    match.v2 = second.v2;
    match.d2 = second.d2;
    unrelated.push_back(match);
  }
  EXPECT_NE(estimate(calibration, unrelated).reason, "");
}

TEST(OdometryMotion, DoesNotDependOnAnythingButItsInput) {
  std::mt19937 generator(5);
  const Calibration calibration = kitti_calibration();
  const auto matches = random_matches(generator, calibration, make_motion(0, 0, -1, 1), 300, 0.3);
  const auto first = estimate(calibration, matches), second = estimate(calibration, matches);
  EXPECT_EQ(first.motion.current_from_previous.matrix(), second.motion.current_from_previous.matrix());
  EXPECT_EQ(first.motion.covariance, second.motion.covariance);
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

struct Drive {
  SyntheticSequence sequence;
  std::vector<SyntheticFrame> frames;

  explicit Drive(const SyntheticOptions& options) : sequence(options) {
    for (int k = 0; k < options.frames; ++k) frames.push_back(sequence.render(k));
  }
};

const Drive& turning_drive() {
  static const Drive drive([] {
    SyntheticOptions options;
    options.frames = 8;
    options.turn_deg = 2.7;
    options.seed = 21;
    options.supersampling = 2;
    return options;
  }());
  return drive;
}

OdometryResult process(StereoOdometry& odometry, const cv::Mat& left, const cv::Mat& right) {
  return odometry.process(image_view(left), image_view(right));
}

void expect_motion(const OdometryResult& result, const Eigen::Isometry3d& truth, const MotionError& most,
                   const std::string& where) {
  ASSERT_TRUE(result.motion) << where << ": " << result.reason;
  const MotionError error = motion_error(result.motion->current_from_previous, truth);
  EXPECT_LT(error.translation_m, most.translation_m) << where;
  EXPECT_LT(error.rotation_deg, most.rotation_deg) << where;
}

/// Each frame's motion from the one before.
void expect_all_motions(const SyntheticSequence& sequence, const std::vector<SyntheticFrame>& frames,
                        const MotionError& most, const std::string& what = "") {
  StereoOdometry odometry(sequence.calibration());
  process(odometry, frames[0].left, frames[0].right);
  for (std::size_t k = 1; k < frames.size(); ++k) {
    expect_motion(process(odometry, frames[k].left, frames[k].right),
                  sequence.motion(static_cast<int>(k)).current_from_previous, most,
                  what + "frame " + std::to_string(k));
  }
}

TEST(StereoOdometry, FollowsATurningDrive) {
  const Drive& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  Eigen::Isometry3d estimated = Eigen::Isometry3d::Identity();
  for (std::size_t k = 0; k < drive.frames.size(); ++k) {
    const OdometryResult result = process(odometry, drive.frames[k].left, drive.frames[k].right);
    EXPECT_GT(result.features, 500);
    if (k == 0) {
      EXPECT_FALSE(result.motion);
      EXPECT_EQ(result.reason, "first frame");
      continue;
    }
    EXPECT_EQ(result.reason, "");
    EXPECT_GE(result.matches, result.inliers);
    expect_motion(result, drive.sequence.motion(static_cast<int>(k)).current_from_previous, {0.01, 0.05},
                  "frame " + std::to_string(k));
    ASSERT_TRUE(result.motion);
    EXPECT_NO_THROW(result.motion->validate());
    estimated = estimated * result.motion->current_from_previous.inverse();
  }
  const Eigen::Isometry3d truth = drive.sequence.world_from_camera(static_cast<int>(drive.frames.size()) - 1);
  EXPECT_LT((estimated.translation() - truth.translation()).norm(), 0.005 * truth.translation().norm());
}

TEST(StereoOdometry, GivesTheSameBitsTwiceAndAfterReset) {
  const Drive& drive = turning_drive();
  StereoOdometry first(drive.sequence.calibration()), second(drive.sequence.calibration());
  process(second, drive.frames[5].left, drive.frames[5].right);
  process(second, drive.frames[6].left, drive.frames[6].right);
  second.reset();
  for (const SyntheticFrame& frame : drive.frames) {
    const OdometryResult a = process(first, frame.left, frame.right), b = process(second, frame.left, frame.right);
    ASSERT_EQ(a.motion.has_value(), b.motion.has_value());
    EXPECT_EQ(a.inliers, b.inliers);
    EXPECT_EQ(a.reason, b.reason);
    if (!a.motion) continue;
    EXPECT_EQ(a.motion->current_from_previous.matrix(), b.motion->current_from_previous.matrix());
    EXPECT_EQ(a.motion->covariance, b.motion->covariance);
  }
}

/// The covariance is a claim: over many motions, squared errors over it average to the six degrees of freedom.
TEST(StereoOdometry, CovarianceIsConsistentWithTheError) {
  SyntheticOptions options;
  options.frames = 8;
  options.seed = 24;
  options.supersampling = 2;
  const Drive straight(options);
  double sum = 0;
  int motions = 0;
  for (const Drive* drive : {&turning_drive(), &straight}) {
    StereoOdometry odometry(drive->sequence.calibration());
    for (int k = 0; k < drive->sequence.frames(); ++k) {
      const OdometryResult result = process(odometry, drive->frames[k].left, drive->frames[k].right);
      if (k == 0) continue;
      ASSERT_TRUE(result.motion) << result.reason;
      const Eigen::Isometry3d error =
          result.motion->current_from_previous * drive->sequence.motion(k).current_from_previous.inverse();
      const Eigen::AngleAxisd rotation(error.linear());
      odometry::Vector6 xi;
      xi << error.translation(), rotation.angle() * rotation.axis();
      sum += xi.dot(result.motion->covariance.inverse() * xi);
      ++motions;
    }
  }
  EXPECT_GT(sum / motions, 0.5 * 6);
  EXPECT_LT(sum / motions, 2.0 * 6);
}

TEST(StereoOdometry, ThreadsChangeNoBit) {
  const Drive& drive = turning_drive();
  const auto motions = [&drive] {
    StereoOdometry odometry(drive.sequence.calibration());
    std::vector<Motion> found;
    for (int k = 0; k < 4; ++k) {
      const OdometryResult result = process(odometry, drive.frames[k].left, drive.frames[k].right);
      if (result.motion) found.push_back(*result.motion);
    }
    return found;
  };
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const std::vector<Motion> expected = motions();
  cv::setNumThreads(4);
  std::vector<Motion> more = motions(), beside[2];
  std::thread first([&] { beside[0] = motions(); }), second([&] { beside[1] = motions(); });
  first.join();
  second.join();
  cv::setNumThreads(threads);
  ASSERT_EQ(expected.size(), 3u);
  for (const auto& found : {more, beside[0], beside[1]}) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_EQ(found[k].current_from_previous.matrix(), expected[k].current_from_previous.matrix());
      EXPECT_EQ(found[k].covariance, expected[k].covariance);
    }
  }
}

TEST(StereoOdometry, FollowsFastMotion) {
  SyntheticOptions options;
  options.frames = 4;
  options.speed_m = 2.5;
  options.turn_deg = 2;
  options.seed = 23;
  options.supersampling = 2;
  const Drive drive(options);
  expect_all_motions(drive.sequence, drive.frames, {0.02, 0.05});
}

// `image` drawn lower by `rows` [px].
cv::Mat lowered(const cv::Mat& image, double rows) {
  const cv::Mat shift = (cv::Mat_<double>(2, 3) << 1, 0, 0, 0, 1, rows);
  cv::Mat out;
  cv::warpAffine(image, out, shift, image.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return out;
}

TEST(StereoOdometry, BearsAVerticalOffsetBetweenTheImages) {
  const Drive& drive = turning_drive();
  for (const double rows : {0.5, -0.5, 1.5}) {
    std::vector<SyntheticFrame> frames(drive.frames.begin(), drive.frames.begin() + 5);
    for (SyntheticFrame& frame : frames) frame.right = lowered(frame.right, rows);
    expect_all_motions(drive.sequence, frames, {0.01, 0.05}, std::to_string(rows) + " rows, ");
  }
}

TEST(StereoOdometry, BlurGivesAGoodMotionOrNone) {
  const Drive& drive = turning_drive();
  int without = 0;
  for (const int length_px : {3, 9, 61}) {
    StereoOdometry odometry(drive.sequence.calibration());
    process(odometry, drive.frames[0].left, drive.frames[0].right);
    cv::Mat left, right;
    cv::blur(drive.frames[1].left, left, {length_px, 1});
    cv::blur(drive.frames[1].right, right, {length_px, 1});
    const OdometryResult result = process(odometry, left, right);
    if (!result.motion) {
      ++without;
      EXPECT_NE(result.reason.find("too few"), std::string::npos) << result.reason;
      continue;
    }
    expect_motion(result, drive.sequence.motion(1).current_from_previous, {0.03, 0.1},
                  std::to_string(length_px) + " px");
  }
  EXPECT_GE(without, 1) << "nothing is left to be matched after 61 px of blur";
  EXPECT_LE(without, 2);
}

TEST(StereoOdometry, BoundsAreOptionsAndTheReasonNamesThem) {
  const Drive& drive = turning_drive();
  const auto reason_with = [&drive](double max_translation_m, double max_rotation_deg) {
    StereoOdometryOptions options;
    options.max_translation_m = max_translation_m;
    options.max_rotation_deg = max_rotation_deg;
    StereoOdometry odometry(drive.sequence.calibration(), options);
    process(odometry, drive.frames[4].left, drive.frames[4].right);
    const OdometryResult result = process(odometry, drive.frames[5].left, drive.frames[5].right);
    EXPECT_EQ(result.motion.has_value(), result.reason.empty());
    return result.reason;
  };
  EXPECT_EQ(reason_with(1, 4), "");
  EXPECT_NE(reason_with(0.3, 4).find("exceeds the bound of 0.30 m"), std::string::npos);
  EXPECT_NE(reason_with(1, 0.2).find("exceeds the bound of 0.20 deg"), std::string::npos);
}

/// What an IMU tells: the rotation; of the translation it knows nothing, so the last one is taken.
TEST(StereoOdometry, RotationOfAnImuGuidesWhereTheSearchIsNarrow) {
  const Drive& drive = turning_drive();
  StereoOdometryOptions options;
  options.max_flow_x_px = 8;
  options.max_flow_y_px = 8;
  const int from = 4, to = 7;
  const Eigen::Isometry3d truth =
      current_from_previous(drive.sequence.world_from_camera(from), drive.sequence.world_from_camera(to));
  Eigen::Isometry3d imu = Eigen::Isometry3d::Identity();
  imu.linear() = truth.linear();
  imu.translation() = 3 * drive.sequence.motion(from).current_from_previous.translation();
  for (const bool with_imu : {false, true}) {
    StereoOdometry odometry(drive.sequence.calibration(), options);
    process(odometry, drive.frames[from].left, drive.frames[from].right);
    const OdometryResult result =
        odometry.process(image_view(drive.frames[to].left), image_view(drive.frames[to].right),
                         with_imu ? std::optional(imu) : std::nullopt);
    ASSERT_EQ(result.motion.has_value(), with_imu) << result.reason;
    if (with_imu) expect_motion(result, truth, {0.03, 0.1}, "with the IMU");
  }
}

/// A fifth of a millimetre a frame: below what one frame can tell, and yet not lost.
TEST(StereoOdometry, CreepingIsNotTakenForStandstill) {
  SyntheticOptions options;
  options.frames = 14;
  options.speed_m = 0.0002;
  options.turn_deg = 0;
  options.wobble = 0;
  options.seed = 25;
  options.supersampling = 2;
  const SyntheticSequence sequence(options);
  StereoOdometry odometry(sequence.calibration());
  double travel_m = 0;
  for (int k = 0; k < options.frames; ++k) {
    const SyntheticFrame frame = sequence.render(k);
    const OdometryResult result = process(odometry, frame.left, frame.right);
    if (k == 0) continue;
    ASSERT_TRUE(result.motion) << result.reason;
    EXPECT_EQ(result.standstill, result.motion->current_from_previous.matrix() == Eigen::Matrix4d::Identity());
    travel_m -= result.motion->current_from_previous.translation().z();
  }
  EXPECT_NEAR(travel_m, sequence.world_from_camera(options.frames - 1).translation().z(), 0.0015);
}

TEST(StereoOdometry, StandstillIsIdentity) {
  const Drive& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  std::mt19937 generator(31);
  std::normal_distribution<double> noise(0, 2);
  for (int k = 0; k < 12; ++k) {
    cv::Mat left = drive.frames[0].left.clone(), right = drive.frames[0].right.clone();
    for (cv::Mat* image : {&left, &right}) {
      for (auto pixel = image->begin<std::uint8_t>(); pixel != image->end<std::uint8_t>(); ++pixel) {
        *pixel = cv::saturate_cast<std::uint8_t>(*pixel + noise(generator));
      }
    }
    const OdometryResult result = process(odometry, left, right);
    if (k == 0) continue;
    ASSERT_TRUE(result.motion) << result.reason;
    EXPECT_TRUE(result.standstill);
    EXPECT_EQ(result.motion->current_from_previous.matrix(), Eigen::Matrix4d::Identity());
    EXPECT_GT(result.motion->covariance.trace(), 0);
  }
  const OdometryResult start = process(odometry, drive.frames[1].left, drive.frames[1].right);
  EXPECT_FALSE(start.standstill);
  expect_motion(start, drive.sequence.motion(1).current_from_previous, {0.01, 0.05}, "starting");
}

TEST(StereoOdometry, BlankImageGivesNoMotionAndTheNextFramesRecover) {
  const Drive& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  const cv::Mat blank(drive.frames[0].left.size(), CV_8UC1, cv::Scalar(90));
  process(odometry, drive.frames[0].left, drive.frames[0].right);
  const OdometryResult lost = process(odometry, blank, blank);
  EXPECT_FALSE(lost.motion);
  EXPECT_EQ(lost.reason, "too few features: 0 of at least 20");
  EXPECT_EQ(lost.features, 0);
  EXPECT_FALSE(process(odometry, drive.frames[1].left, drive.frames[1].right).motion);
  EXPECT_TRUE(process(odometry, drive.frames[2].left, drive.frames[2].right).motion);
}

TEST(StereoOdometry, BearsDroppedFramesAndExposureJumps) {
  const Drive& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  const auto expect_from_to = [&](const OdometryResult& result, int from, int to) {
    const Eigen::Isometry3d truth =
        current_from_previous(drive.sequence.world_from_camera(from), drive.sequence.world_from_camera(to));
    expect_motion(result, truth, {0.03, 0.1}, std::to_string(from) + " to " + std::to_string(to));
  };
  process(odometry, drive.frames[0].left, drive.frames[0].right);
  process(odometry, drive.frames[1].left, drive.frames[1].right);
  expect_from_to(process(odometry, drive.frames[3].left, drive.frames[3].right), 1, 3);
  cv::Mat left, right;
  drive.frames[4].left.convertTo(left, CV_8U, 0.6, 15);
  drive.frames[4].right.convertTo(right, CV_8U, 0.6, 15);
  expect_from_to(process(odometry, left, right), 3, 4);
  expect_from_to(process(odometry, drive.frames[5].left, drive.frames[5].right), 4, 5);
}

TEST(StereoOdometry, SixteenBitImagesGiveTheSameMotion) {
  const Drive& drive = turning_drive();
  StereoOdometry narrow(drive.sequence.calibration()), wide(drive.sequence.calibration());
  for (int k = 0; k < 2; ++k) {
    cv::Mat left, right;
    drive.frames[k].left.convertTo(left, CV_16U, 256);
    drive.frames[k].right.convertTo(right, CV_16U, 256);
    const auto a = process(narrow, drive.frames[k].left, drive.frames[k].right), b = process(wide, left, right);
    ASSERT_EQ(a.motion.has_value(), b.motion.has_value());
    if (k == 0) continue;
    EXPECT_LT(motion_error(a.motion->current_from_previous, b.motion->current_from_previous).translation_m, 0.005);
  }
}

TEST(StereoOdometry, PriorGuidesAndAWrongOneDoesNotMislead) {
  const Drive& drive = turning_drive();
  const Eigen::Isometry3d truth = drive.sequence.motion(1).current_from_previous;
  for (const Eigen::Isometry3d& prior : {truth, make_motion(0.5, 0.2, 2, -12), make_motion(0, 0, -90, 0)}) {
    StereoOdometry odometry(drive.sequence.calibration());
    process(odometry, drive.frames[0].left, drive.frames[0].right);
    const auto result = odometry.process(image_view(drive.frames[1].left), image_view(drive.frames[1].right), prior);
    expect_motion(result, truth, {0.01, 0.05}, "");
  }
}

TEST(StereoOdometry, LargeMovingVehicleDoesNotWin) {
  SyntheticOptions options;
  options.frames = 6;
  options.moving_object = true;
  options.moving_object_scale = 7;
  options.seed = 22;
  options.supersampling = 2;
  const Drive drive(options);
  EXPECT_GT(cv::countNonZero(drive.frames[3].left_moving), 0.4 * drive.frames[3].left.total());
  expect_all_motions(drive.sequence, drive.frames, {0.02, 0.1});
}

TEST(StereoOdometry, ImagesTooSmallForFeaturesGiveNoMotion) {
  StereoOdometry odometry(kitti_calibration());
  for (const auto& [width, height] : {std::pair{1, 1}, {7, 5}, {18, 400}, {400, 19}, {64, 40}}) {
    odometry.reset();
    std::mt19937 generator(41);
    odometry::GreyImage image = random_image(generator, width, height);
    const ImageView view{image.pixels.data(), width, height, width, PixelType::kU8};
    EXPECT_EQ(odometry.process(view, view).reason, "first frame");
    EXPECT_NO_THROW(odometry.process(view, view));
  }
}

TEST(StereoOdometry, RefusesWhatItCannotUse) {
  const Drive& drive = turning_drive();
  const Calibration calibration = drive.sequence.calibration();
  StereoOdometryOptions options;
  options.max_translation_m = std::nan("");
  expect_refused([&] { StereoOdometry odometry(calibration, options); }, {"max_translation_m"});
  expect_refused([&] { StereoOdometry odometry(Calibration{}); }, {"fx"});

  StereoOdometry odometry(calibration);
  const cv::Mat small(40, 50, CV_8UC1, cv::Scalar(0));
  expect_refused([&] { odometry.process(ImageView{}, ImageView{}); }, {"empty"});
  expect_refused([&] { odometry.process(image_view(drive.frames[0].left), image_view(small)); }, {"50x40"});
  process(odometry, drive.frames[0].left, drive.frames[0].right);
  expect_refused([&] { process(odometry, small, small); }, {"size changed", "50x40", "reset"});
  EXPECT_TRUE(process(odometry, drive.frames[1].left, drive.frames[1].right).motion)
      << "a refused call changes nothing";
}

TEST(StereoOdometry, KittiOdometryExcerpt) {
  EGOSGM_REQUIRE_DATA(data);
  const auto folder = data / "odometry" / "sequences" / "A";
  const auto poses = read_poses(folder / "poses.txt");
  StereoOdometry odometry(read_calibration(folder / "calib.txt"));
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  double length_m = 0, translation_m = 0, rotation_deg = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    char name[32];
    std::snprintf(name, sizeof(name), "%06zu.png", k);
    const OdometryResult result =
        process(odometry, read_grey_png(folder / "image_0" / name), read_grey_png(folder / "image_1" / name));
    if (k == 0) continue;
    ASSERT_TRUE(result.motion) << name << ": " << result.reason;
    const Eigen::Isometry3d truth = current_from_previous(poses[k - 1], poses[k]);
    const MotionError error = motion_error(result.motion->current_from_previous, truth);
    translation_m += error.translation_m / (poses.size() - 1);
    rotation_deg += error.rotation_deg / (poses.size() - 1);
    length_m += truth.translation().norm();
    pose = pose * result.motion->current_from_previous.inverse();
  }
  const double drift = ((poses.front().inverse() * poses.back()).translation() - pose.translation()).norm() / length_m;
  RecordProperty("drift_percent", std::to_string(100 * drift));
  EXPECT_LT(drift, 0.008);
  EXPECT_LT(translation_m, 0.009);
  EXPECT_LT(rotation_deg, 0.045);
}

}  // namespace
}  // namespace egosgm::vision
