// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/moving_objects.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "egosgm/error.h"
#include "egosgm/vision/synthetic.h"
#include "host/odometry/geometry.h"
#include "tests/vision/images.h"
#include "vision/pixel_motion.h"
#include "vision/window_sums.h"

namespace egosgm::vision {
namespace {

constexpr int kFirst = 3, kFrames = 4;  // frames in which the bus ahead is seen whole

const SyntheticSequence& street() {
  static const SyntheticSequence sequence({.frames = kFirst + kFrames + 1,
                                           .width = 480,
                                           .height = 180,
                                           .seed = 3,
                                           .moving_object = true,
                                           .noise_grey = 0.5,
                                           .supersampling = 2});
  return sequence;
}

/// The object of the truth that has the most pixels, and they.
struct Truth {
  SyntheticObject object;
  Image labels;
};

Truth largest(int frame) {
  SyntheticSceneFlow flow = street().scene_flow(frame);
  const auto most = std::max_element(flow.moving.begin(), flow.moving.end(), [&](const auto& a, const auto& b) {
    const auto area = [](const SyntheticObject& o) { return (o.right - o.left) * (o.bottom - o.top); };
    return area(a) < area(b);
  });
  return {*most, flow.objects};
}

LabelledObjects process(ObjectTracker& tracker, int frame, bool has_motion = true) {
  const SyntheticFrame images = street().render(frame);
  const std::optional<Motion> motion = has_motion ? std::optional(street().motion(frame)) : std::nullopt;
  return tracker.process(images.left, images.left_disparity, images.left_moving, motion);
}

const MovingObject* found_at(const LabelledObjects& found, const Truth& truth) {
  for (const MovingObject& object : found.moving) {
    int common = 0, either = 0;
    for_each_pixel(truth.labels.size(), [&](int x, int y) {
      const bool is_true = truth.labels.at<std::uint8_t>(y, x) == truth.object.id;
      const bool is_own = found.labels.at<std::uint8_t>(y, x) == object.id;
      common += is_true && is_own;
      either += is_true || is_own;
    });
    if (common > 0.7 * either) return &object;
  }
  return nullptr;
}

bool is_empty(const Image& labels) { return count_nonzero(labels) == 0; }

TEST(MovingObjects, VehicleHasItsMotionInEachFrame) {
  ObjectTracker tracker(street().calibration());
  EXPECT_TRUE(process(tracker, kFirst, false).moving.empty());
  int id = 0;
  for (int k = kFirst + 1; k < kFirst + kFrames; ++k) {
    const LabelledObjects found = process(tracker, k);
    const Truth truth = largest(k), before = largest(k - 1);
    const MovingObject* object = found_at(found, truth);
    ASSERT_TRUE(object) << k;
    EXPECT_EQ(object->age, k - kFirst);
    EXPECT_EQ(object->id, id ? id : object->id);
    id = object->id;
    const Eigen::Isometry3d& motion = before.object.next_from_current;
    const Eigen::Vector3d centre = before.object.centre_m;
    EXPECT_LT((motion * centre - object->current_from_previous * centre).norm(), 0.05) << k;
    EXPECT_LT(Eigen::AngleAxisd(motion.linear().transpose() * object->current_from_previous.linear()).angle(), 0.03);
    // The truth's centre is that of the whole body.
    EXPECT_LT((object->centre_m - truth.object.centre_m).norm(), 1.5);
    EXPECT_LT((object->velocity_m - truth.object.velocity_m).norm(), 0.08 * truth.object.velocity_m.norm() + 0.03);
    const Eigen::Vector3d sigma = object->velocity_covariance_m2.diagonal().cwiseSqrt();
    EXPECT_GT(sigma.minCoeff(), 1e-4);
    EXPECT_LT(sigma.maxCoeff(), 0.1);
    EXPECT_LE(std::abs(object->left - truth.object.left), 12);
    EXPECT_LE(std::abs(object->bottom - truth.object.bottom), 12);
  }
}

TEST(MovingObjects, SceneFlowIsThatOfTheEarlierFrame) {
  ObjectTracker tracker(street().calibration());
  process(tracker, kFirst, false);
  EXPECT_FALSE(tracker.scene_flow());
  process(tracker, kFirst + 1);
  const std::optional<SceneFlow> flow = tracker.scene_flow();
  ASSERT_TRUE(flow);
  const SyntheticSceneFlow truth = street().scene_flow(kFirst);
  const Truth vehicle = largest(kFirst);
  int asked = 0, right = 0, still = 0, still_right = 0;
  for_each_pixel(truth.flow.size(), [&](int x, int y) {
    const float *own = flow->flow.row<float>(y) + 2 * x, *exact = truth.flow.row<float>(y) + 2 * x;
    if (std::isnan(exact[0]) || !truth.seen_next.at<std::uint8_t>(y, x)) return;
    const bool is_right = std::hypot(own[0] - exact[0], own[1] - exact[1]) < 1 &&
                          std::abs(flow->next_disparity.at<float>(y, x) - truth.next_disparity.at<float>(y, x)) < 1;
    const int label = truth.objects.at<std::uint8_t>(y, x);
    asked += label == vehicle.object.id;
    right += label == vehicle.object.id && is_right;
    still += label == 0;
    still_right += label == 0 && is_right;
  });
  EXPECT_GT(right, 0.9 * asked);
  EXPECT_GT(still_right, 0.97 * still);
  const LabelledObjects earlier{flow->moving, flow->labels};
  const MovingObject* object = found_at(earlier, vehicle);
  ASSERT_TRUE(object);
  EXPECT_LT((object->velocity_m - vehicle.object.velocity_m).norm(), 0.08 * vehicle.object.velocity_m.norm() + 0.03);
  EXPECT_LE(std::abs(object->left - vehicle.object.left), 12);
  const Eigen::Vector3d seen_later = object->current_from_previous * object->centre_m;
  const Eigen::Isometry3d back = street().motion(kFirst + 1).current_from_previous.inverse();
  EXPECT_LT((object->velocity_m - (back * seen_later - object->centre_m)).norm(), 1e-9);
  EXPECT_TRUE(flow->camera.current_from_previous.isApprox(street().motion(kFirst + 1).current_from_previous));
}

TEST(MovingObjects, WhatStandsIsNoObject) {
  ObjectTracker tracker(street().calibration());
  for (int k = kFirst; k < kFirst + 3; ++k) {
    const SyntheticFrame images = street().render(k);
    Image marked(images.left.size(), kU8, 0);
    for_each_pixel(marked.size(), [&](int x, int y) {
      const bool is_block = x / 40 % 2 == 0 && y / 40 % 2 == 0;  // of what stands: the mask is wrong there
      if (is_block && !images.left_moving.at<std::uint8_t>(y, x)) marked.at<std::uint8_t>(y, x) = 255;
    });
    const LabelledObjects found = tracker.process(images.left, images.left_disparity, marked, street().motion(k));
    int labelled = 0;
    for_each_pixel(marked.size(), [&](int x, int y) {
      labelled += found.labels.at<std::uint8_t>(y, x) && !images.left_moving.at<std::uint8_t>(y, x);
    });
    EXPECT_LT(labelled, 0.005 * static_cast<double>(marked.pixels())) << k;
  }
}

TEST(MovingObjects, NoMarksOrNoMotionNoObject) {
  ObjectTracker tracker(street().calibration());
  process(tracker, kFirst, false);
  EXPECT_FALSE(process(tracker, kFirst + 1).moving.empty());
  const LabelledObjects without = process(tracker, kFirst + 2, false);
  EXPECT_TRUE(without.moving.empty());
  EXPECT_TRUE(is_empty(without.labels));
  EXPECT_FALSE(tracker.scene_flow());
  const LabelledObjects again = process(tracker, kFirst + 3);
  ASSERT_FALSE(again.moving.empty());
  EXPECT_EQ(again.moving[0].age, 1);

  ObjectTracker unmarked(street().calibration());
  for (int k = kFirst; k < kFirst + 2; ++k) {
    const SyntheticFrame images = street().render(k);
    const Image none(images.left.size(), kU8, 0);
    EXPECT_TRUE(unmarked.process(images.left, images.left_disparity, none, street().motion(k)).moving.empty());
  }
  ASSERT_TRUE(unmarked.scene_flow());
  EXPECT_TRUE(is_empty(unmarked.scene_flow()->labels));
}

TEST(MovingObjects, WhatLooksOtherwiseGoesOnAndBeginsWhereItsMotionExplainsFarMore) {
  const Truth truth = largest(kFirst + 2);
  for (const int amplitude : {15, 20}) {
    SyntheticFrame images = street().render(kFirst + 2);
    std::mt19937 random(5);
    for_each_pixel(images.left.size(), [&](int x, int y) {
      if (truth.labels.at<std::uint8_t>(y, x) != truth.object.id) return;
      std::uint8_t& grey = images.left.at<std::uint8_t>(y, x);
      const int noise = static_cast<int>(random() % static_cast<unsigned>(2 * amplitude + 1)) - amplitude;
      grey = static_cast<std::uint8_t>(std::clamp(grey + noise, 0, 255));
    });
    for (const bool is_known : {true, false}) {
      ObjectTracker tracker(street().calibration());
      if (is_known) process(tracker, kFirst, false);
      process(tracker, kFirst + 1, is_known);
      const LabelledObjects found =
          tracker.process(images.left, images.left_disparity, images.left_moving, street().motion(kFirst + 2));
      EXPECT_EQ(found_at(found, truth) != nullptr, is_known || amplitude == 15) << amplitude;
    }
  }
}

TEST(MovingObjects, ImagesOf16BitsAndMapsWithoutValues) {
  ObjectTracker tracker(street().calibration()), of_8_bits(street().calibration());
  for (int k = kFirst; k < kFirst + 2; ++k) {
    const SyntheticFrame images = street().render(k);
    Image wide(images.left.size(), kU16);
    for_each_pixel(wide.size(), [&](int x, int y) {
      wide.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(256 * images.left.at<std::uint8_t>(y, x));
    });
    const LabelledObjects found = tracker.process(wide, images.left_disparity, images.left_moving, street().motion(k));
    const LabelledObjects expected =
        of_8_bits.process(images.left, images.left_disparity, images.left_moving, street().motion(k));
    EXPECT_EQ(found.moving.empty(), k == kFirst);
    EXPECT_EQ(largest_difference(found.labels, expected.labels), 0);
  }
  const Image black(tracker
                        .process(Image(180, 480, kU8, 0), Image(180, 480, kF32, kInvalidDisparity),
                                 Image(180, 480, kU8, 255), Motion())
                        .labels);
  EXPECT_TRUE(is_empty(black));
}

/// Each picture comes twice, as from a camera of half the rate; its poses go on, or stand.
TEST(MovingObjects, PicturesThatRepeatAreOneMoment) {
  ObjectTracker once(street().calibration()), twice(street().calibration()), with_poses(street().calibration());
  for (int k = kFirst; k < kFirst + kFrames; ++k) {
    const SyntheticFrame images = street().render(k);
    const auto next = [&](ObjectTracker& tracker, const Motion& motion) {
      return tracker.process(images.left, images.left_disparity, images.left_moving, motion);
    };
    Motion half = street().motion(k);
    half.current_from_previous.translation() *= 0.5;
    Motion rest = half;
    rest.current_from_previous = street().motion(k).current_from_previous * half.current_from_previous.inverse();
    const LabelledObjects expected = next(once, street().motion(k));
    const LabelledObjects found = next(twice, street().motion(k));
    const LabelledObjects with_half = next(with_poses, k == kFirst ? half : rest);
    ASSERT_EQ(found.moving.size(), expected.moving.size()) << k;
    ASSERT_EQ(with_half.moving.size(), expected.moving.size()) << k;
    for (std::size_t i = 0; i < expected.moving.size(); ++i) {
      EXPECT_EQ(found.moving[i].id, expected.moving[i].id) << k;
      EXPECT_EQ(found.moving[i].age, expected.moving[i].age) << k;
      EXPECT_EQ(found.moving[i].velocity_m, expected.moving[i].velocity_m) << k;
      EXPECT_EQ(with_half.moving[i].age, expected.moving[i].age) << k;
      EXPECT_LT((with_half.moving[i].velocity_m - expected.moving[i].velocity_m).norm(), 1e-6) << k;
    }
    const LabelledObjects again = next(twice, Motion());
    EXPECT_TRUE(again.moving.empty() && is_empty(again.labels)) << k;
    const std::optional<SceneFlow> flow = twice.scene_flow();
    ASSERT_TRUE(flow);
    EXPECT_NEAR(flow->flow.at<float>(90, 2 * 240), 0, 1e-3);
    Motion to_next = street().motion(k + 1);
    to_next.current_from_previous.translation() *= 0.5;
    next(with_poses, to_next);
  }
}

/// Marks with gaps make several candidates of one vehicle, which share pixels.
TEST(MovingObjects, PixelsThatCandidatesShareCountOnce) {
  ObjectTracker tracker(street().calibration());
  bool has_any = false;
  for (int k = kFirst; k < kFirst + kFrames; ++k) {
    const SyntheticFrame images = street().render(k);
    Image marked = images.left_moving.clone();
    for_each_pixel(marked.size(), [&](int x, int y) {
      if (x % 32 < 8) marked.at<std::uint8_t>(y, x) = 0;
    });
    const LabelledObjects found = tracker.process(images.left, images.left_disparity, marked, street().motion(k));
    for (const MovingObject& object : found.moving) {
      const std::vector<double> labels = values_of(found.labels);
      EXPECT_EQ(object.pixels, std::count(labels.begin(), labels.end(), object.id)) << object.id << " of frame " << k;
      has_any = true;
    }
  }
  EXPECT_TRUE(has_any);
}

TEST(MovingObjects, RefusalsLeaveTheState) {
  EXPECT_THROW(ObjectTracker(Calibration{}), InvalidArgument);
  ObjectTracker tracker(street().calibration());
  process(tracker, kFirst, false);
  const SyntheticFrame images = street().render(kFirst + 1);
  const Motion motion = street().motion(kFirst + 1);
  const Image small(10, 10, kU8, 0), small_map(10, 10, kF32, 1);
  Motion none;
  none.current_from_previous.linear() *= 2;
  const std::tuple<Image, Image, Image, Motion> refused[] = {
      {images.left, images.left_disparity, small, motion},
      {images.left, images.left_moving, images.left_moving, motion},
      {images.left, images.left_disparity, images.left_disparity, motion},
      {images.left_disparity, images.left_disparity, images.left_moving, motion},
      {small, small_map, small, motion},
      {Image(), Image(), Image(), motion},
      {images.left, images.left_disparity, images.left_moving, none}};
  for (std::size_t i = 0; i < std::size(refused); ++i) {
    EXPECT_THROW(std::apply([&](const auto&... given) { tracker.process(given...); }, refused[i]), InvalidArgument)
        << i;
  }
  EXPECT_TRUE(found_at(process(tracker, kFirst + 1), largest(kFirst + 1)));
}

TEST(MovingObjects, PixelsMoveAsTheirPointsDo) {
  const Calibration oblong{.fx = 400, .fy = 700, .cx = 240, .cy = 90, .baseline_m = 0.5, .doffs_px = 7};
  const Eigen::Isometry3d motion(Eigen::Translation3d(0.3, -0.1, -0.8) *
                                 Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized()));
  const auto there = PixelMotion(oblong, motion)(20, 170, 12);
  ASSERT_TRUE(there);
  EXPECT_TRUE(there->isApprox(odometry::project(oblong, motion * odometry::triangulate(oblong, 20, 170, 12)), 1e-9));
}

TEST(MovingObjects, RowsOfPixelsMoveAsEachPixelDoes) {
  const Eigen::Isometry3d motion(Eigen::Translation3d(0.3, -0.1, -4) *
                                 Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY()));
  const PixelMotion move(street().calibration(), motion);
  std::vector<float> disparities;
  for (int i = 0; i < 37; ++i) disparities.push_back(3.0f + 2 * static_cast<float>(i));
  disparities[5] = NAN;
  MovedRow there;
  move.of_row(11, 90, disparities.data(), 37, there);
  int behind = 0;
  for (int i = 0; i < 37; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto expected = i == 5 ? std::nullopt : move(11 + i, 90, disparities[k]);
    ASSERT_EQ(std::isnan(there.u[k]), !expected) << i;
    if (!expected) {
      ++behind;
      continue;
    }
    EXPECT_FLOAT_EQ(there.u[k], static_cast<float>(expected->x())) << i;
    EXPECT_FLOAT_EQ(there.v[k], static_cast<float>(expected->y())) << i;
    EXPECT_FLOAT_EQ(there.d[k], static_cast<float>(expected->z())) << i;
  }
  EXPECT_GT(behind, 1);  // near surfaces pass the camera
}

TEST(MovingObjects, MeansTakeWhatIsAlikeAround) {
  const Box box{3, 2, 3 + 21, 2 + 13};
  std::mt19937 random(7);
  BoxValues disparities(box.area()), values(box.area());
  for (std::size_t i = 0; i < box.area(); ++i) {
    disparities[i] = random() % 9 == 0 ? NAN : static_cast<float>(random() % 6);
    values[i] = std::isnan(disparities[i]) || random() % 4 == 0 ? NAN : static_cast<float>(random() % 100);
  }
  const BoxValues means = means_of_alike(box, disparities, values);
  for (int y = box.top; y < box.bottom; ++y) {
    for (int x = box.left; x < box.right; ++x) {
      const float d = disparities[box.index(x, y)];
      float sum = 0;
      int count = 0;
      for (int v = y - 4; v <= y + 4; v += 2) {
        for (int u = x - 4; u <= x + 4; u += 2) {
          if (!box.contains(u, v) || std::isnan(values[box.index(u, v)])) continue;
          if (!(std::abs(disparities[box.index(u, v)] - d) <= alike_px(d))) continue;
          sum += values[box.index(u, v)];
          ++count;
        }
      }
      EXPECT_EQ(means[box.index(x, y)], count > 2 ? sum / static_cast<float>(count) : 0) << x << " " << y;
    }
  }
}

}  // namespace
}  // namespace egosgm::vision
