// SPDX-License-Identifier: Apache-2.0
#include "host/stages/forward_warp.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/reference/disparity_space.h"
#include "tests/reference/forward_warp.h"
#include "tests/support/stage_case.h"

namespace egosgm {
namespace {

using testing::kNone;
constexpr shared::ImageSize kSize{101, 61};
constexpr shared::DisparityRange kRange{0, 64};
const Calibration kCalibration{.fx = 100, .fy = 100, .cx = 50, .cy = 30, .baseline_m = 0.5};  // Z = 50 / d

testing::HostMaps warp(shared::ImageSize size, const Calibration& calibration, shared::DisparityRange range,
                       float process_noise_px2, const testing::HostMaps& belief, const Motion& motion, int pixels = 0,
                       Views views = Views::kBoth) {
  ocl::Context& context = testing::shared_context();
  ForwardWarp stage(context, size, calibration, {.process_noise_px2 = process_noise_px2}, range, pixels);
  const StereoMaps in = testing::upload(context, size, belief);
  StereoMaps out = testing::upload(context, size, testing::earlier_maps(size));
  const std::size_t pixels_of_both = 2 * pixel_count(size);
  const FlagMap evidence =
      testing::on_device(context, belief.evidence.empty() ? std::vector<cl_uchar>(pixels_of_both) : belief.evidence);
  FlagMap moved = testing::on_device<cl_uchar>(context, pixels_of_both, 77);
  stage.warp(in, evidence, motion, out, moved, views);
  testing::HostMaps maps = testing::download_marked(context, out);
  maps.evidence = moved.read(context);
  return maps;
}

testing::HostMaps warp(const testing::HostMaps& belief, const Motion& motion) {
  return warp(kSize, kCalibration, kRange, 0.25f, belief, motion);
}

std::size_t at(shared::ImageSize size, int view, int x, int y) {
  return (static_cast<std::size_t>(view) * size.height + y) * size.width + x;
}

Motion translation(double x_m, double y_m, double z_m) {
  Motion motion;
  motion.current_from_previous.translation() = Eigen::Vector3d(x_m, y_m, z_m);
  return motion;
}

Motion rotation(const Eigen::Vector3d& axis, double angle_rad) {
  Motion motion;
  motion.current_from_previous.linear() = Eigen::AngleAxisd(angle_rad, axis.normalized()).toRotationMatrix();
  return motion;
}

Eigen::Matrix<double, 6, 6> random_covariance(std::mt19937& random, double scale) {
  std::normal_distribution<double> normal(0, scale);
  const Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::NullaryExpr([&] { return normal(random); });
  return root * root.transpose();
}

Motion random_motion(std::mt19937& random, double metres, double radians) {
  std::uniform_real_distribution<double> unit(-1, 1);
  Motion motion = rotation({unit(random), unit(random), unit(random)}, radians * unit(random));
  motion.current_from_previous.translation() = metres * Eigen::Vector3d(unit(random), unit(random), unit(random));
  return motion;
}

std::size_t count_valid(const std::vector<float>& disparity, int view) {
  const auto first = disparity.begin() + view * static_cast<std::ptrdiff_t>(disparity.size() / 2);
  const auto last = first + static_cast<std::ptrdiff_t>(disparity.size() / 2);
  return static_cast<std::size_t>(std::count_if(first, last, [](float d) { return d > kNone; }));
}

EGOSGM_TEST_AT_ALL_SIZES(ForwardWarpTest);

TEST_P(ForwardWarpTest, EqualsReference) {
  const shared::ImageSize size = GetParam();
  std::mt19937 random(11);
  Calibration calibration{
      .fx = 0.6 * size.width, .fy = 0.7 * size.width, .cx = 0.48 * size.width, .cy = 0.55 * size.height};
  calibration.baseline_m = 0.5;
  testing::HostMaps before = testing::earlier_maps(size);
  before.hidden.assign(before.disparity.size(), 0), before.evidence.assign(before.disparity.size(), 77);
  for (const shared::DisparityRange range : {shared::DisparityRange{0, 128}, {-20, 37}, {3, 1}}) {
    calibration.doffs_px = range.min < 0 ? 25.5 : 0;
    // The noise of few step makes many equal disparities, so that ties are met.
    testing::HostMaps belief = testing::random_maps(size, static_cast<float>(range.min) - 1,
                                                    static_cast<float>(range.min + range.count), 0.2, 12);
    for (float& d : belief.disparity) d = std::nearbyint(4 * d) / 4;
    for (std::size_t i = 0; i < belief.disparity.size(); ++i) belief.evidence.push_back(i * 37 % 251);
    for (int repetition = 0; repetition < 3; ++repetition) {
      Motion motion = random_motion(random, 0.5, 0.05);
      if (repetition > 0) motion.covariance = random_covariance(random, 0.01);
      shared::DisparityMotion left = disparity_motion(calibration, motion, EGOSGM_LEFT);
      shared::DisparityMotion right = disparity_motion(calibration, motion, EGOSGM_RIGHT);
      SCOPED_TRACE(range.min);
      testing::expect_reference(
          size, before,
          [&](int pixels, Views views) { return warp(size, calibration, range, 0.25f, belief, motion, pixels, views); },
          [&](int step) {
            left.row_step = right.row_step = step;
            return reference::without_absent_rows(size, step,
                                                  reference::forward_warp(size, range, left, right, 0.25f, belief));
          });
    }
  }
}

// Sideways by 0.1 m: a disparity of 20 px moves by 4 px, one of 1 px by 0.2 px.
TEST(ForwardWarp, NearestSurfaceWins) {
  for (const int direction : {-1, 1}) {
    testing::HostMaps belief = testing::empty_maps(kSize);
    belief.disparity[at(kSize, EGOSGM_LEFT, 50, 30)] = 20;
    belief.disparity[at(kSize, EGOSGM_LEFT, 50 + 4 * direction, 30)] = 1;
    belief.variance[at(kSize, EGOSGM_LEFT, 50, 30)] = 0.5f;
    belief.variance[at(kSize, EGOSGM_LEFT, 50 + 4 * direction, 30)] = 7;
    const testing::HostMaps predicted = warp(belief, translation(0.1 * direction, 0, 0));
    EXPECT_EQ(count_valid(predicted.disparity, EGOSGM_LEFT), 1u);
    EXPECT_EQ(predicted.disparity[at(kSize, EGOSGM_LEFT, 50 + 4 * direction, 30)], 20);
    EXPECT_EQ(predicted.variance[at(kSize, EGOSGM_LEFT, 50 + 4 * direction, 30)], 0.75f);
  }
}

// Down by a tenth of the disparity, which is 10 + y / 5 on the upper 40 rows and 30 px more below them.
TEST(ForwardWarp, WhatLandsBetweenRowsHasItsSurfacesDisparityThere) {
  testing::HostMaps belief = testing::empty_maps(kSize);
  const auto plane = [](double y) { return 10 + y / 5; };
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      belief.disparity[at(kSize, EGOSGM_LEFT, x, y)] = static_cast<float>(plane(y) + (y < 40 ? 0 : 30));
    }
  }
  struct Case {
    int step, last_row, lands_on;  // the last row above the jump
  };
  for (const auto& [step, last_row, lands_on] : {Case{1, 39, 41}, {2, 38, 40}, {3, 39, 42}}) {
    const auto predicted = warp(kSize, kCalibration, kRange, 0, belief, translation(0, 0.05, 0), 0, {1, step});
    const auto at_row = [&](int y) { return predicted.disparity[at(kSize, EGOSGM_LEFT, 50, y)]; };
    for (int y = 6; y < 40; y += step) {
      if (y == 27 && step != 2) continue;  // rows stretch, and none lands there
      EXPECT_NEAR(at_row(y), plane((y - 1) / 1.02), 0.003 * step) << "row " << y << " of every " << step;
    }
    EXPECT_EQ(at_row(lands_on), static_cast<float>(plane(last_row))) << "another surface is no neighbour";
  }
}

// Back by as much as the surface is away: x - cx and the disparity halve, so columns 53 .. 55 land on 52.
TEST(ForwardWarp, OfEqualDisparitiesTheLeastCertainWins) {
  for (const int uncertain : {53, 54, 55}) {
    testing::HostMaps belief = testing::empty_maps(kSize);
    for (const int x : {53, 54, 55}) {
      belief.disparity[at(kSize, EGOSGM_LEFT, x, 30)] = 10;
      belief.variance[at(kSize, EGOSGM_LEFT, x, 30)] = x == uncertain ? 4.0f : 1.0f;
    }
    const testing::HostMaps predicted = warp(belief, translation(0, 0, 5));
    EXPECT_EQ(predicted.disparity[at(kSize, EGOSGM_LEFT, 52, 30)], 5);
    EXPECT_EQ(predicted.variance[at(kSize, EGOSGM_LEFT, 52, 30)], 1.25f);
  }
}

TEST(ForwardWarp, EvidenceGoesWithTheNearest) {
  testing::HostMaps belief = testing::empty_maps(kSize);
  belief.evidence.assign(belief.disparity.size(), 9);
  belief.disparity[at(kSize, EGOSGM_LEFT, 50, 30)] = 20;
  belief.evidence[at(kSize, EGOSGM_LEFT, 50, 30)] = 5;
  belief.disparity[at(kSize, EGOSGM_LEFT, 54, 30)] = 1;
  for (const int x : {70, 71, 72}) {  // all land on one pixel
    belief.disparity[at(kSize, EGOSGM_RIGHT, x, 40)] = 10;
    belief.evidence[at(kSize, EGOSGM_RIGHT, x, 40)] = static_cast<std::uint8_t>(x == 71 ? 30 : 20);
  }
  const testing::HostMaps sideways = warp(belief, translation(0.1, 0, 0));
  EXPECT_EQ(sideways.evidence[at(kSize, EGOSGM_LEFT, 54, 30)], 5) << "not the most of all, but the nearest's";
  EXPECT_EQ(sideways.evidence[at(kSize, EGOSGM_LEFT, 50, 30)], 0) << "nothing lands there";
  const testing::HostMaps back = warp(belief, translation(0, 0, 10));
  EXPECT_EQ(*std::max_element(back.evidence.begin() + static_cast<std::ptrdiff_t>(at(kSize, EGOSGM_RIGHT, 0, 0)),
                              back.evidence.end()),
            30)
      << "of equal ones, the most";
}

TEST(ForwardWarp, PointsBehindTheCameraVanish) {
  testing::HostMaps belief = testing::empty_maps(kSize);
  for (float& d : belief.disparity) d = 10;
  const testing::HostMaps predicted = warp(belief, translation(0, 0, -6));
  EXPECT_EQ(predicted.disparity, testing::empty_maps(kSize).disparity);
  EXPECT_EQ(predicted.variance, testing::empty_maps(kSize).variance);

  // At infinity the disparity does not tell, and half a turn mirrors the image into itself.
  for (float& d : belief.disparity) d = 0;
  EXPECT_EQ(warp(belief, rotation({0, 1, 0}, 3.14159)).disparity, testing::empty_maps(kSize).disparity);
}

TEST(ForwardWarp, DropsWhatLeavesTheDisparityRange) {
  testing::HostMaps belief = testing::empty_maps(kSize);
  belief.disparity[at(kSize, EGOSGM_LEFT, 50, 30)] = 50;
  EXPECT_EQ(count_valid(warp(belief, translation(0, 0, -0.2)).disparity, EGOSGM_LEFT), 1u);   // 62.5 of 0 .. 63
  EXPECT_EQ(count_valid(warp(belief, translation(0, 0, -0.25)).disparity, EGOSGM_LEFT), 0u);  // 66.7
}

// 1 m away, 0.25 m forward: column 53 moves to 54 and out of the range; what lies far away in column 54 stays there.
TEST(ForwardWarp, WhatComesNearerThanTheRangeHidesWhatIsBehind) {
  for (const int pixels : {1, 16}) {
    testing::HostMaps belief = testing::empty_maps(kSize);
    belief.disparity[at(kSize, EGOSGM_LEFT, 54, 30)] = 1;
    const Motion forward = translation(0, 0, -0.25);
    EXPECT_EQ(count_valid(warp(kSize, kCalibration, kRange, 0.25f, belief, forward, pixels).disparity, EGOSGM_LEFT),
              1u);
    belief.disparity[at(kSize, EGOSGM_LEFT, 53, 30)] = 50;
    const testing::HostMaps hidden = warp(kSize, kCalibration, kRange, 0.25f, belief, forward, pixels);
    EXPECT_EQ(hidden.disparity, testing::empty_maps(kSize).disparity);
    EXPECT_EQ(hidden.variance, testing::empty_maps(kSize).variance);
    EXPECT_EQ(hidden.hidden[at(kSize, EGOSGM_LEFT, 54, 30)], 1);
    EXPECT_EQ(std::count(hidden.hidden.begin(), hidden.hidden.end(), 0), 2 * 101 * 61 - 1);
  }
}

TEST(ForwardWarp, SurvivesWildMotions) {
  std::mt19937 random(14);
  testing::HostMaps belief = testing::random_maps(kSize, -300, 3000, 0.1, 15);
  for (std::size_t i = 0; i < belief.variance.size(); i += 7) belief.variance[i] = 1e30f;
  for (std::size_t i = 0; i < belief.disparity.size(); i += 5) belief.disparity[i] = 0;
  for (const double metres : {0.1, 10.0, 1e5, 1e30}) {
    for (int repetition = 0; repetition < 5; ++repetition) {
      Motion motion = random_motion(random, metres, 3.2);
      motion.covariance = random_covariance(random, metres);
      const testing::HostMaps predicted = warp(belief, motion);
      const testing::HostMaps expected =
          reference::forward_warp(kSize, kRange, disparity_motion(kCalibration, motion, EGOSGM_LEFT),
                                  disparity_motion(kCalibration, motion, EGOSGM_RIGHT), 0.25f, belief);
      EXPECT_TRUE(testing::same_maps(predicted, {expected.disparity, expected.variance}, kSize)) << metres << " m";
      for (std::size_t i = 0; i < predicted.disparity.size(); ++i) {
        const float d = predicted.disparity[i], p = predicted.variance[i];
        ASSERT_TRUE(d == kNone ? p == 0 : d >= 0 && d <= 63 && p >= 0.25f && p <= 1e6f)
            << d << ", variance " << p << ", " << metres << " m";
      }
    }
  }
}

const Calibration kUneven{.fx = 120, .fy = 95, .cx = 47.25, .cy = 31.5, .baseline_m = 0.4, .doffs_px = 2};

// One point in both maps: each view's prediction lies where the moved point is seen (eqs. 1-4).
TEST(ForwardWarp, BothViewsFollowThePointInSpace) {
  std::mt19937 random(16);
  std::uniform_int_distribution<int> xs(30, 70), ys(15, 45), disparities(5, 25);
  for (int repetition = 0; repetition < 50; ++repetition) {
    const int x = xs(random), y = ys(random), d = disparities(random);
    const Motion motion = random_motion(random, 0.4, 0.1);
    testing::HostMaps belief = testing::empty_maps(kSize);
    belief.disparity[at(kSize, EGOSGM_LEFT, x, y)] = static_cast<float>(d);
    belief.disparity[at(kSize, EGOSGM_RIGHT, x - d, y)] = static_cast<float>(d);

    const testing::HostMaps predicted = warp(kSize, kUneven, kRange, 0, belief, motion);
    for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
      const reference::DisparityPoint from{static_cast<double>(view == EGOSGM_LEFT ? x : x - d), static_cast<double>(y),
                                           static_cast<double>(d)};
      const reference::DisparityPoint seen = reference::moved(kUneven, motion, view, from);
      if (std::nearbyint(seen.x) < 0 || std::nearbyint(seen.x) >= kSize.width) continue;
      if (std::nearbyint(seen.y) < 0 || std::nearbyint(seen.y) >= kSize.height) continue;
      const std::size_t target =
          at(kSize, view, static_cast<int>(std::nearbyint(seen.x)), static_cast<int>(std::nearbyint(seen.y)));
      EXPECT_NEAR(predicted.disparity[target], seen.disparity, 1e-4) << "view " << view << ", " << repetition;
      EXPECT_EQ(count_valid(predicted.disparity, view), 1u);
    }
  }
}

// q = J Sigma J^T, with J from finite differences of a perturbed motion.
double variance_by_differences(const Motion& motion, const reference::DisparityPoint& point) {
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 1, 6> jacobian;
  for (int i = 0; i < 6; ++i) {
    const auto disparity_after = [&](double step) {
      Motion perturbed;
      if (i < 3) perturbed.current_from_previous.translation()[i] = step;
      if (i >= 3) perturbed = rotation(Eigen::Vector3d::Unit(i - 3), step);
      perturbed.current_from_previous = perturbed.current_from_previous * motion.current_from_previous;
      return reference::moved(kUneven, perturbed, EGOSGM_LEFT, point).disparity;
    };
    jacobian[i] = (disparity_after(kStep) - disparity_after(-kStep)) / (2 * kStep);
  }
  return (jacobian * motion.covariance * jacobian.transpose())(0, 0);
}

TEST(ForwardWarp, VarianceFollowsFromTheMotionsCovariance) {
  std::mt19937 random(17);
  std::uniform_int_distribution<int> xs(30, 70), ys(15, 45), disparities(5, 25);
  for (int repetition = 0; repetition < 20; ++repetition) {
    const int x = xs(random), y = ys(random), d = disparities(random);
    Motion motion = random_motion(random, 0.3, 0.02);
    motion.covariance = random_covariance(random, 0.05);
    testing::HostMaps belief = testing::empty_maps(kSize);
    belief.disparity[at(kSize, EGOSGM_LEFT, x, y)] = static_cast<float>(d);
    belief.disparity[at(kSize, EGOSGM_RIGHT, x - d, y)] = static_cast<float>(d);
    const testing::HostMaps predicted = warp(kSize, kUneven, kRange, 0, belief, motion);
    const double expected =
        variance_by_differences(motion, {static_cast<double>(x), static_cast<double>(y), static_cast<double>(d)});
    for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
      if (count_valid(predicted.disparity, view) == 0) continue;
      const auto first = predicted.variance.begin() + view * static_cast<std::ptrdiff_t>(predicted.variance.size() / 2);
      const float variance =
          *std::max_element(first, first + static_cast<std::ptrdiff_t>(predicted.variance.size() / 2));
      EXPECT_NEAR(variance / expected, 1, 1e-3) << "view " << view << ", " << repetition;
    }
  }
}

}  // namespace
}  // namespace egosgm
