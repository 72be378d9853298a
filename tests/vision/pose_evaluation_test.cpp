// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/pose_evaluation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/expect_refused.h"

namespace egosgm::vision {
namespace {

using testing::expect_refused;

using Poses = std::vector<Eigen::Isometry3d>;

/// Straight on, `step_m` and `turn_rad` (about y) per frame.
Poses drive(int frames, double step_m, double turn_rad = 0) {
  Poses poses{Eigen::Isometry3d::Identity()};
  for (int k = 1; k < frames; ++k) {
    poses.push_back(poses.back() * Eigen::Translation3d(0, 0, step_m) *
                    Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY()));
  }
  return poses;
}

TEST(PoseEvaluation, EqualPosesHaveNoError) {
  const PoseEvaluation result = evaluate_poses(drive(40, 1, 0.02), drive(40, 1, 0.02));
  EXPECT_EQ(result.motions.size(), 39u);
  EXPECT_NEAR(result.path_length_m, 39, 1e-12);
  EXPECT_NEAR(result.end_drift_percent, 0, 1e-12);
  EXPECT_NEAR(result.segment_translation_percent, 0, 1e-12);
  EXPECT_NEAR(result.segment_rotation_deg_per_m, 0, 1e-12);
}

TEST(PoseEvaluation, FirstPoseDoesNotMatter) {
  Poses estimate = drive(30, 1, 0.01);
  const Eigen::Isometry3d away =
      Eigen::Translation3d(5, 6, 7) * Eigen::Isometry3d(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitX()));
  for (auto& pose : estimate) pose = away * pose;
  EXPECT_NEAR(evaluate_poses(estimate, drive(30, 1, 0.01)).end_drift_m, 0, 1e-9);
}

TEST(PoseEvaluation, ScaleErrorIsDrift) {
  const PoseEvaluation result = evaluate_poses(drive(51, 1.02), drive(51, 1.0));
  EXPECT_NEAR(result.end_drift_m, 1.0, 1e-9);
  EXPECT_NEAR(result.end_drift_percent, 2.0, 1e-9);
  EXPECT_NEAR(result.translation_rmse_m, 0.02, 1e-12);
  EXPECT_NEAR(result.translation_mean_m, 0.02, 1e-12);
  EXPECT_NEAR(result.motions[7].translation_m, 0.02, 1e-12);
  EXPECT_TRUE(result.short_segments);
  // A segment ends at the first frame beyond its length: 6 m for 5 m, so 0.12 m of error for 5 m.
  ASSERT_EQ(result.segments.size(), 9u);  // 50 m needs a frame beyond 50 m
  EXPECT_EQ(result.segments[0].length_m, 5);
  EXPECT_EQ(result.segments[0].segments, 45);
  EXPECT_NEAR(result.segments[0].translation_percent, 2.4, 1e-9);
}

TEST(PoseEvaluation, TurnErrorIsRotation) {
  const double error_rad = 0.001;
  const PoseEvaluation result = evaluate_poses(drive(1001, 1, error_rad), drive(1001, 1));
  EXPECT_NEAR(result.rotation_rmse_rad, error_rad, 1e-9);
  EXPECT_NEAR(result.rotation_mean_rad, error_rad, 1e-9);
  EXPECT_NEAR(result.rotation_end_drift_deg, 1000 * error_rad * 180 / M_PI, 1e-6);
  EXPECT_FALSE(result.short_segments);
  ASSERT_EQ(result.segments.size(), 8u);
  EXPECT_EQ(result.segments[0].length_m, 100);
  EXPECT_EQ(result.segments[0].segments, 90);  // starts at 0, 10, ... 890; 900 would need frame 1001
  EXPECT_NEAR(result.segments[0].rotation_deg_per_m, 101 * error_rad * 180 / M_PI / 100, 1e-9);
}

TEST(PoseEvaluation, MeanAndRootMeanSquareDiffer) {
  Poses estimate = drive(5, 1);
  for (std::size_t k = 2; k < estimate.size(); ++k) estimate[k].translation().z() += 0.4;  // one motion of four
  const PoseEvaluation result = evaluate_poses(estimate, drive(5, 1));
  EXPECT_NEAR(result.translation_mean_m, 0.1, 1e-12);
  EXPECT_NEAR(result.translation_rmse_m, 0.2, 1e-12);
}

TEST(PoseEvaluation, StandingStillHasNoPercent) {
  const PoseEvaluation result = evaluate_poses(drive(5, 0), drive(5, 0));
  EXPECT_TRUE(std::isnan(result.end_drift_percent));
  EXPECT_TRUE(std::isnan(result.segment_translation_percent));
  EXPECT_TRUE(result.segments.empty());
}

TEST(PoseEvaluation, NumbersOfPosesMustFit) {
  expect_refused([] { evaluate_poses(drive(3, 1), drive(4, 1)); }, {"3 estimated and 4 true"});
  expect_refused([] { evaluate_poses(drive(1, 1), drive(1, 1)); }, {"at least two"});
}

}  // namespace
}  // namespace egosgm::vision
