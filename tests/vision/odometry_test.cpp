// SPDX-License-Identifier: Apache-2.0
// Drives, whole images in and motions out.
#include "egosgm/odometry.h"

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
#include "egosgm/vision/opencv.h"
#include "egosgm/vision/poses_io.h"
#include "egosgm/vision/synthetic.h"
#include "host/odometry/geometry.h"
#include "tests/odometry/motions.h"
#include "tests/support/expect_refused.h"
#include "tests/vision/data_folder.h"
#include "tests/vision/images.h"
#include "tests/vision/rendered_video.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

const RenderedVideo& turning_drive() {
  static const RenderedVideo drive({.frames = 8, .seed = 21, .turn_deg = 2.7, .supersampling = 2});
  return drive;
}

OdometryResult process(StereoOdometry& odometry, const Image& left, const Image& right) {
  return odometry.process(image_view(left), image_view(right));
}
OdometryResult process(StereoOdometry& odometry, const SyntheticFrame& frame) {
  return process(odometry, frame.left, frame.right);
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
  process(odometry, frames[0]);
  for (std::size_t k = 1; k < frames.size(); ++k) {
    expect_motion(process(odometry, frames[k]), sequence.motion(static_cast<int>(k)).current_from_previous, most,
                  what + "frame " + std::to_string(k));
  }
}

TEST(StereoOdometry, FollowsATurningDrive) {
  const RenderedVideo& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  Eigen::Isometry3d estimated = Eigen::Isometry3d::Identity();
  for (std::size_t k = 0; k < drive.frames.size(); ++k) {
    const OdometryResult result = process(odometry, drive.frames[k]);
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

/// The covariance is a claim: over many motions, squared errors over it average to the six degrees of freedom.
TEST(StereoOdometry, CovarianceIsConsistentWithTheError) {
  SyntheticOptions options{.frames = 8, .seed = 24, .supersampling = 2};
  const RenderedVideo straight(options);
  options.height = 360;  // features are sought at half the size
  const RenderedVideo large(options);
  for (const RenderedVideo* drive : {&turning_drive(), &straight, &large}) {
    double sum = 0;
    int motions = 0;
    StereoOdometry odometry(drive->sequence.calibration());
    for (int k = 0; k < drive->sequence.frames(); ++k) {
      const OdometryResult result = process(odometry, drive->frames[k]);
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
    EXPECT_GT(sum / motions, 0.5 * 6);
    EXPECT_LT(sum / motions, 2.0 * 6);
  }
}

TEST(StereoOdometry, GivesTheSameBitsAgainAfterAResetAndInThreads) {
  const RenderedVideo& drive = turning_drive();
  StereoOdometry used(drive.sequence.calibration());
  for (const int k : {5, 6}) process(used, drive.frames[k]);
  used.reset();
  const auto motions = [&drive](StereoOdometry odometry) {
    std::vector<OdometryResult> found;
    for (int k = 0; k < 4; ++k) found.push_back(process(odometry, drive.frames[k]));
    return found;
  };
  const auto anew = [&] { return motions(StereoOdometry(drive.sequence.calibration())); };
  const std::vector<OdometryResult> expected = anew();
  std::vector<OdometryResult> again = motions(std::move(used)), beside[2];
  std::thread first([&] { beside[0] = anew(); }), second([&] { beside[1] = anew(); });
  first.join();
  second.join();
  for (const auto& found : {again, beside[0], beside[1]}) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_EQ(found[k].reason, expected[k].reason);
      EXPECT_EQ(found[k].inliers, expected[k].inliers);
      ASSERT_EQ(found[k].motion.has_value(), k > 0);
      if (k == 0) continue;
      EXPECT_EQ(found[k].motion->current_from_previous.matrix(), expected[k].motion->current_from_previous.matrix());
      EXPECT_EQ(found[k].motion->covariance, expected[k].motion->covariance);
    }
  }
}

TEST(StereoOdometry, FollowsFastMotionAndIsNotLedByALargeVehicle) {
  const RenderedVideo fast({.frames = 4, .seed = 23, .speed_m = 2.5, .turn_deg = 2, .supersampling = 2});
  expect_all_motions(fast.sequence, fast.frames, {0.02, 0.05}, "fast, ");
  const RenderedVideo led(
      {.frames = 6, .seed = 22, .moving_object = true, .moving_object_scale = 7, .supersampling = 2});
  EXPECT_GT(count_nonzero(led.frames[3].left_moving), 0.4 * led.frames[3].left.pixels());
  expect_all_motions(led.sequence, led.frames, {0.02, 0.1}, "beside a vehicle, ");
}

// `image` drawn lower by `rows` [px].
Image shifted(const Image& image, double columns, double rows) {
  const cv::Mat shift = (cv::Mat_<double>(2, 3) << 1, 0, columns, 0, 1, rows);
  cv::Mat out;
  cv::warpAffine(mat_of(image), out, shift, {image.cols, image.rows}, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  return image_of(out);
}

TEST(StereoOdometry, BearsAVerticalOffsetBetweenTheImages) {
  const RenderedVideo& drive = turning_drive();
  for (const double rows : {0.5, -0.5, 1.5}) {
    std::vector<SyntheticFrame> frames(drive.frames.begin(), drive.frames.begin() + 5);
    for (SyntheticFrame& frame : frames) frame.right = shifted(frame.right, 0, rows);
    expect_all_motions(drive.sequence, frames, {0.01, 0.05}, std::to_string(rows) + " rows, ");
  }
}

// Cameras that converge see infinity at -doffs_px.
TEST(StereoOdometry, MatchesFromInfinityOn) {
  const RenderedVideo& drive = turning_drive();
  for (const double doffs_px : {40, -40}) {
    Calibration calibration = drive.sequence.calibration();
    calibration.doffs_px = doffs_px;
    StereoOdometry odometry(calibration);
    for (int k = 0; k < 5; ++k) {
      const SyntheticFrame& frame = drive.frames[k];
      const OdometryResult result = process(odometry, frame.left, shifted(frame.right, doffs_px, 0));
      if (k == 0) continue;
      expect_motion(result, drive.sequence.motion(k).current_from_previous, {0.01, 0.05},
                    "doffs " + std::to_string(doffs_px) + ", frame " + std::to_string(k));
    }
  }
}

TEST(StereoOdometry, BlurGivesAGoodMotionOrNone) {
  const RenderedVideo& drive = turning_drive();
  int without = 0;
  for (const int length_px : {3, 9, 61}) {
    StereoOdometry odometry(drive.sequence.calibration());
    process(odometry, drive.frames[0]);
    cv::Mat left, right;
    cv::blur(mat_of(drive.frames[1].left), left, {length_px, 1});
    cv::blur(mat_of(drive.frames[1].right), right, {length_px, 1});
    const OdometryResult result = process(odometry, image_of(left), image_of(right));
    if (!result.motion) {
      ++without;
      EXPECT_EQ(result.reason.find(length_px == 61 ? "too few matches" : "inlier ratio"), 0u) << result.reason;
      continue;
    }
    expect_motion(result, drive.sequence.motion(1).current_from_previous, {0.03, 0.1},
                  std::to_string(length_px) + " px");
  }
  EXPECT_GE(without, 1) << "nothing is left to be matched after 61 px of blur";
  EXPECT_LE(without, 2);
}

/// What an IMU tells: the rotation; of the translation it knows nothing, so the last one is taken.
TEST(StereoOdometry, RotationOfAnImuGuidesWhereTheSearchIsNarrow) {
  const RenderedVideo& drive = turning_drive();
  const StereoOdometryOptions options{.max_flow_x_px = 8, .max_flow_y_px = 8};
  const int from = 4, to = 7;
  const Eigen::Isometry3d truth =
      current_from_previous(drive.sequence.world_from_camera(from), drive.sequence.world_from_camera(to));
  Eigen::Isometry3d imu = Eigen::Isometry3d::Identity();
  imu.linear() = truth.linear();
  imu.translation() = 3 * drive.sequence.motion(from).current_from_previous.translation();
  for (const bool with_imu : {false, true}) {
    StereoOdometry odometry(drive.sequence.calibration(), options);
    process(odometry, drive.frames[from]);
    const OdometryResult result =
        odometry.process(image_view(drive.frames[to].left), image_view(drive.frames[to].right),
                         with_imu ? std::optional(imu) : std::nullopt);
    ASSERT_EQ(result.motion.has_value(), with_imu) << result.reason;
    if (with_imu) expect_motion(result, truth, {0.03, 0.1}, "with the IMU");
  }
}

/// The few features of the rough motion have fewer inliers than all features need; those of all of them have enough.
TEST(StereoOdometry, FewRoughInliersDoWhereMostOfAllAgree) {
  const RenderedVideo& drive = turning_drive();
  const int min_inliers = 120;  // 87 matches are rough ones
  StereoOdometry odometry(drive.sequence.calibration(), {.min_inliers = min_inliers});
  process(odometry, drive.frames[4]);
  const OdometryResult result = process(odometry, drive.frames[5]);
  ASSERT_TRUE(result.motion) << result.reason;
  EXPECT_GT(result.inliers, min_inliers);
  expect_motion(result, drive.sequence.motion(5).current_from_previous, {0.03, 0.1}, "with few rough inliers");
}

/// A fifth of a millimetre a frame: below what one frame can tell, and yet not lost.
TEST(StereoOdometry, CreepingIsNotTakenForStandstill) {
  const SyntheticSequence sequence(
      {.frames = 14, .seed = 25, .speed_m = 0.0002, .turn_deg = 0, .wobble = 0, .supersampling = 2});
  StereoOdometry odometry(sequence.calibration());
  double travel_m = 0;
  for (int k = 0; k < sequence.frames(); ++k) {
    const OdometryResult result = process(odometry, sequence.render(k));
    if (k == 0) continue;
    ASSERT_TRUE(result.motion) << result.reason;
    EXPECT_EQ(result.standstill, result.motion->current_from_previous.matrix() == Eigen::Matrix4d::Identity());
    travel_m -= result.motion->current_from_previous.translation().z();
  }
  EXPECT_NEAR(travel_m, sequence.world_from_camera(sequence.frames() - 1).translation().z(), 0.0015);
}

TEST(StereoOdometry, StandstillIsIdentity) {
  const RenderedVideo& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  std::mt19937 generator(31);
  std::normal_distribution<double> noise(0, 2);
  for (int k = 0; k < 12; ++k) {
    Image left = drive.frames[0].left.clone(), right = drive.frames[0].right.clone();
    for (Image* image : {&left, &right}) {
      visit_values(*image, [&](auto& pixel) {
        pixel = static_cast<std::uint8_t>(std::clamp(std::nearbyint(pixel + noise(generator)), 0.0, 255.0));
      });
    }
    const OdometryResult result = process(odometry, left, right);
    if (k == 0) continue;
    ASSERT_TRUE(result.motion) << result.reason;
    EXPECT_TRUE(result.standstill);
    EXPECT_EQ(result.motion->current_from_previous.matrix(), Eigen::Matrix4d::Identity());
    EXPECT_GT(result.motion->covariance.trace(), 0);
  }
  const OdometryResult start = process(odometry, drive.frames[1]);
  EXPECT_FALSE(start.standstill);
  expect_motion(start, drive.sequence.motion(1).current_from_previous, {0.01, 0.05}, "starting");
}

TEST(StereoOdometry, BlankImageGivesNoMotionAndTheNextFramesRecover) {
  const RenderedVideo& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  const Image blank(drive.frames[0].left.size(), kU8, 90);
  process(odometry, drive.frames[0]);
  const OdometryResult lost = process(odometry, blank, blank);
  EXPECT_FALSE(lost.motion);
  EXPECT_EQ(lost.reason, "too few features: 0 of at least 20");
  EXPECT_EQ(lost.features, 0);
  EXPECT_FALSE(process(odometry, drive.frames[1]).motion);
  EXPECT_TRUE(process(odometry, drive.frames[2]).motion);
}

TEST(StereoOdometry, BearsDroppedFramesAndExposureJumps) {
  const RenderedVideo& drive = turning_drive();
  StereoOdometry odometry(drive.sequence.calibration());
  const auto expect_from_to = [&](const OdometryResult& result, int from, int to) {
    const Eigen::Isometry3d truth =
        current_from_previous(drive.sequence.world_from_camera(from), drive.sequence.world_from_camera(to));
    expect_motion(result, truth, {0.03, 0.1}, std::to_string(from) + " to " + std::to_string(to));
  };
  process(odometry, drive.frames[0]);
  process(odometry, drive.frames[1]);
  expect_from_to(process(odometry, drive.frames[3]), 1, 3);
  const Image left = as_bytes(drive.frames[4].left, 0.6, 15), right = as_bytes(drive.frames[4].right, 0.6, 15);
  expect_from_to(process(odometry, left, right), 3, 4);
  expect_from_to(process(odometry, drive.frames[5]), 4, 5);
}

TEST(StereoOdometry, SixteenBitImagesGiveTheSameMotion) {
  const RenderedVideo& drive = turning_drive();
  StereoOdometry narrow(drive.sequence.calibration()), wide(drive.sequence.calibration());
  for (int k = 0; k < 2; ++k) {
    const auto deep = [](const Image& bytes) {
      Image image(bytes.size(), kU16);
      std::transform(bytes.row(0), bytes.row(0) + bytes.pixels(), image.row<std::uint16_t>(0),
                     [](int value) { return static_cast<std::uint16_t>(256 * value); });
      return image;
    };
    const auto a = process(narrow, drive.frames[k]),
               b = process(wide, deep(drive.frames[k].left), deep(drive.frames[k].right));
    ASSERT_EQ(a.motion.has_value(), b.motion.has_value());
    if (k == 0) continue;
    EXPECT_LT(motion_error(a.motion->current_from_previous, b.motion->current_from_previous).translation_m, 0.005);
  }
}

TEST(StereoOdometry, FindsTheMotionAtNight) {
  // Most of the picture holds less than twenty grey levels.
  SyntheticOptions options{.frames = 4, .noise_grey = 0.5, .exposure = 0.08, .supersampling = 2};
  const RenderedVideo night(options);
  expect_all_motions(night.sequence, night.frames, {0.03, 0.1});
  options.height = 480;
  options.noise_grey = 2;
  const RenderedVideo noisy(options);
  expect_all_motions(noisy.sequence, noisy.frames, {0.05, 0.1});
}

TEST(StereoOdometry, PriorGuidesAndAWrongOneDoesNotMislead) {
  const RenderedVideo& drive = turning_drive();
  const Eigen::Isometry3d truth = drive.sequence.motion(1).current_from_previous;
  for (const Eigen::Isometry3d& prior : {truth, make_motion(0.5, 0.2, 2, -12), make_motion(0, 0, -90, 0)}) {
    StereoOdometry odometry(drive.sequence.calibration());
    process(odometry, drive.frames[0]);
    const auto result = odometry.process(image_view(drive.frames[1].left), image_view(drive.frames[1].right), prior);
    expect_motion(result, truth, {0.01, 0.05}, "");
  }
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

TEST(StereoOdometry, BearsACalibrationThatNoCameraHas) {
  const RenderedVideo& drive = turning_drive();
  Calibration calibration = drive.sequence.calibration();
  calibration.fx = 1e6;
  calibration.fy = 1e-300;  // what is seen through it lies at infinity
  StereoOdometryOptions options;
  options.max_flow_y_px = 1e4;
  StereoOdometry odometry(calibration, options);
  for (const SyntheticFrame& frame : drive.frames) EXPECT_FALSE(process(odometry, frame.left, frame.right).motion);
}

TEST(StereoOdometry, RefusesWhatItCannotUse) {
  const RenderedVideo& drive = turning_drive();
  const Calibration calibration = drive.sequence.calibration();
  expect_refused([&] { StereoOdometry(calibration, {.max_translation_m = std::nan("")}); }, {"max_translation_m"});
  expect_refused([&] { StereoOdometry odometry(Calibration{}); }, {"fx"});

  StereoOdometry odometry(calibration);
  const Image small(40, 50, kU8, 0);
  expect_refused([&] { odometry.process(ImageView{}, ImageView{}); }, {"empty"});
  expect_refused([&] { odometry.process(image_view(drive.frames[0].left), image_view(small)); }, {"50x40"});
  process(odometry, drive.frames[0]);
  expect_refused([&] { process(odometry, small, small); }, {"size changed", "50x40", "reset"});
  Eigen::Isometry3d prior = Eigen::Isometry3d::Identity();
  prior.translation().z() = std::nan("");
  const ImageView image = image_view(drive.frames[0].left);
  ImageView flat = image;
  flat.stride_bytes = 0;
  expect_refused([&] { odometry.process(image, flat); }, {"right image: a stride of 0 bytes is shorter than a row"});
  expect_refused([&] { odometry.process(image, image, prior); }, {"motion: not all values are finite"});
  EXPECT_TRUE(process(odometry, drive.frames[1]).motion) << "a refused call changes nothing";
}

TEST(RealData, KittiOdometryExcerpt) {
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
        process(odometry, read_grey_image(folder / "image_0" / name), read_grey_image(folder / "image_1" / name));
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
