// SPDX-License-Identifier: Apache-2.0
// What calibrations and motions are refused.
#include "egosgm/calibration.h"

#include <gtest/gtest.h>

#include <limits>

#include "egosgm/motion.h"
#include "tests/support/expect_refused.h"

namespace egosgm {
namespace {

using testing::expect_refused;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

Calibration good_calibration() { return {.fx = 700, .fy = 710, .cx = 600, .cy = 180, .baseline_m = 0.54}; }

TEST(Calibration, TakesWhatACameraCanBe) {
  Calibration calibration = good_calibration();
  EXPECT_NO_THROW(calibration.validate());
  calibration.cx = -5, calibration.cy = 1e4, calibration.doffs_px = -30;  // a crop's principal point may lie outside
  EXPECT_NO_THROW(calibration.validate());
}

TEST(Calibration, RefusesEachValueByItsName) {
  const std::pair<const char*, double Calibration::*> values[] = {{"fx", &Calibration::fx},
                                                                  {"fy", &Calibration::fy},
                                                                  {"cx", &Calibration::cx},
                                                                  {"cy", &Calibration::cy},
                                                                  {"baseline_m", &Calibration::baseline_m},
                                                                  {"doffs_px", &Calibration::doffs_px}};
  for (const auto& [name, value] : values) {
    for (const double bad : {kNan, kInfinity, -kInfinity}) {
      Calibration calibration = good_calibration();
      calibration.*value = bad;
      expect_refused([&] { calibration.validate(); },
                     {"calibration: " + std::string(name) + " is ", ": give a finite number"});
    }
  }
  for (const auto& [name, value] : {values[0], values[1], values[4]}) {
    for (const double bad : {0.0, -1.0}) {
      Calibration calibration = good_calibration();
      calibration.*value = bad;
      expect_refused([&] { calibration.validate(); }, {"calibration: " + std::string(name) + " is ", "is positive"});
    }
  }
  Calibration swapped = good_calibration();
  swapped.baseline_m = -0.54;
  expect_refused([&] { swapped.validate(); }, {"are left and right swapped?"});
  expect_refused([] { Calibration().validate(); }, {"fx is 0"});
}

Motion turned(double angle) {
  Motion motion;
  motion.current_from_previous.rotate(Eigen::AngleAxisd(angle, Eigen::Vector3d(0.2, 0.9, -0.3).normalized()));
  motion.current_from_previous.translation() = Eigen::Vector3d(0.1, -0.02, -1.4);
  return motion;
}

TEST(Motion, TakesAnyRigidOne) {
  EXPECT_NO_THROW(Motion().validate());
  for (const double angle : {-3.1, -0.01, 0.5, 2.0}) EXPECT_NO_THROW(turned(angle).validate()) << angle;
  Motion rounded = turned(0.3);
  rounded.current_from_previous.linear().array() += 2e-5;  // as a text file rounds
  EXPECT_NO_THROW(rounded.validate());
  Motion known = turned(0.1);
  known.covariance.setConstant(0.25);
  EXPECT_NO_THROW(known.validate());
}

TEST(Motion, RefusesWhatIsNotFinite) {
  for (const double bad : {kNan, kInfinity, -kInfinity}) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        Motion motion = turned(0.2);
        motion.current_from_previous.matrix()(row, column) = bad;
        expect_refused([&] { motion.validate(); }, {"motion: not all values are finite"});
      }
    }
    for (int row = 0; row < 6; ++row) {
      Motion motion = turned(0.2);
      motion.covariance(row, 5) = motion.covariance(5, row) = bad;
      expect_refused([&] { motion.validate(); }, {"motion: the covariance"});
    }
  }
}

TEST(Motion, RefusesWhatIsNoneBySayingWhy) {
  const std::string no_rotation = "motion: its 3x3 part is not a rotation";
  const std::pair<std::vector<std::string>, void (*)(Motion&)> cases[] = {
      {{no_rotation, "give an orthonormal"}, [](Motion& m) { m.current_from_previous.linear() *= 1.001; }},
      {{no_rotation, "it mirrors"}, [](Motion& m) { m.current_from_previous.linear().col(0) *= -1; }},
      {{no_rotation}, [](Motion& m) { m.current_from_previous.linear()(0, 1) += 0.01; }},
      {{no_rotation}, [](Motion& m) { m.current_from_previous.linear().setZero(); }},
      {{"motion: ", "0 0 0 1"}, [](Motion& m) { m.current_from_previous.matrix()(3, 3) = 2; }},
      {{"motion: ", "0 0 0 1"}, [](Motion& m) { m.current_from_previous.matrix().row(3).setZero(); }},
      {{"motion: the covariance", "give zero if it is not known"}, [](Motion& m) { m.covariance(4, 4) = -1e-9; }},
      {{"motion: the covariance is not symmetric"}, [](Motion& m) { m.covariance.setIdentity()(0, 3) = 0.01; }}};
  for (const auto& [parts, spoil] : cases) {
    Motion motion = turned(0.2);
    spoil(motion);
    SCOPED_TRACE(::testing::Message() << motion.current_from_previous.matrix() << "\n" << motion.covariance);
    expect_refused([&] { motion.validate(); }, parts);
  }
}

// A small motion exp(xi) after the first one of two is a small one after both: T2 exp(xi) T1 = exp(xi') T2 T1.
TEST(Motion, AddsThePerturbationsOfTwo) {
  constexpr double kSmall = 1e-6;
  Motion first = turned(0.2), second = turned(-0.7);
  first.current_from_previous.pretranslate(Eigen::Vector3d(0.5, -2, 3));
  second.current_from_previous.pretranslate(Eigen::Vector3d(4, 1, -2));
  const Eigen::Matrix<double, 6, 1> xi = (Eigen::Matrix<double, 6, 1>() << 1, -2, 3, 0.5, 2, -1).finished();
  first.covariance = xi * xi.transpose();
  second.covariance(2, 2) = 7;
  const Motion both = second * first;

  Eigen::Isometry3d small = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d turn = kSmall * xi.tail<3>();
  small.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  small.translation() = kSmall * xi.head<3>();
  const Eigen::Isometry3d after =
      second.current_from_previous * small * second.current_from_previous.inverse(Eigen::Isometry);
  EXPECT_TRUE((after * both.current_from_previous)
                  .isApprox(second.current_from_previous * small * first.current_from_previous, 1e-12));
  const Eigen::AngleAxisd turned_by(after.rotation());
  Eigen::Matrix<double, 6, 1> moved;
  moved << after.translation() / kSmall, turned_by.axis() * turned_by.angle() / kSmall;
  EXPECT_TRUE(both.covariance.isApprox(moved * moved.transpose() + second.covariance, 1e-4)) << both.covariance;
}

}  // namespace
}  // namespace egosgm
