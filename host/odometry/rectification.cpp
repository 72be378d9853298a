// SPDX-License-Identifier: Apache-2.0
#include "host/odometry/rectification.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace egosgm::odometry {
namespace {

using Terms = RectificationError::Terms;
using Square = Eigen::Matrix<double, RectificationError::kTerms, RectificationError::kTerms>;

constexpr double kCauchy2 = 18;  // wide: until it is learnt, the error itself makes residuals large
constexpr double kRowNoise_px = 0.15;
constexpr double kClearRowError_px = 0.15;
// Successive frames measure much the same points with much the same error: each counts for a part of its information.
constexpr double kIndependence = 0.25;
constexpr double kMemory = 0.998;  // of what was learnt, from frame to frame: cameras warm up

constexpr int kRowOffset = 1, kRoll = 3;  // among the terms

// The basis of the right image's error against the left one's.
Terms column_basis(const Calibration& c, double u, double v) {
  const double x = (u - c.cx) / c.fx, y = (v - c.cy) / c.fy;
  Terms basis;
  basis << 1, 0, x, y, x * x, x * y, 2 * x * y, 3 * x * x + y * y, x * (x * x + y * y), 0, 0, 0;
  return basis;
}

Terms row_basis(const Calibration& c, double u, double v) {
  const double x = (u - c.cx) / c.fx, y = (v - c.cy) / c.fy;
  Terms basis;
  basis << 0, 1, y, -x, x * y, y * y, x * x + 3 * y * y, 2 * x * y, y * (x * x + y * y), 0, 0, 0;
  return basis;
}

// The basis of the left image's error.
Eigen::Matrix<double, 2, RectificationError::kTerms> left_basis(const Calibration& c, double u, double v) {
  const double x = (u - c.cx) / c.fx, y = (v - c.cy) / c.fy;
  Eigen::Matrix<double, 2, RectificationError::kTerms> basis;
  basis.setZero();
  basis.rightCols<3>() << 2 * x * y, 3 * x * x + y * y, x * (x * x + y * y),  //
      x * x + 3 * y * y, 2 * x * y, y * (x * x + y * y);
  return basis;
}

}  // namespace

double RectificationError::disparity_px(const Calibration& calibration, double u, double v) const {
  return -column_basis(calibration, u, v).dot(terms_);
}

double RectificationError::row_px(const Calibration& calibration, double u, double v) const {
  return row_basis(calibration, u, v).dot(terms_);
}

void RectificationError::correct(const Calibration& calibration, std::vector<PointMatch>& matches) const {
  for (PointMatch& match : matches) {
    match.d1 -= disparity_px(calibration, match.u1, match.v1);
    match.d2 -= disparity_px(calibration, match.u2, match.v2);
    match.row_error2 -= row_px(calibration, match.u2, match.v2);
    const Eigen::Vector2d left1 = left_basis(calibration, match.u1, match.v1) * terms_;
    const Eigen::Vector2d left2 = left_basis(calibration, match.u2, match.v2) * terms_;
    match.u1 -= left1.x();
    match.v1 -= left1.y();
    match.u2 -= left2.x();
    match.v2 -= left2.y();
  }
}

// The distance between the rows of the two images tells how good the calibration is, and so what to expect of
// the terms that only the motion shows. A constant offset and roll tell nothing of lenses, and the rows alone show them
// well: they stay out of it.
Square RectificationError::prior_information(const Calibration& calibration) const {
  // In pixels for a pair whose rows differ by one.
  Terms deviation;
  deviation << 0.6, 0, 1, 0, 20, 2, 2, 10, 2, 4, 4, 4;
  const Square ridge = Square::Identity();
  const Terms terms = (rows_.information + ridge).ldlt().solve(rows_.right);
  double sum = 0;
  for (const double x : {-0.7, -0.35, 0.35, 0.7}) {
    for (const double y : {-0.2, 0.0, 0.2}) {
      Terms basis = row_basis(calibration, calibration.cx + x * calibration.fx, calibration.cy + y * calibration.fy);
      basis[kRowOffset] = basis[kRoll] = 0;
      const double row = basis.dot(terms);
      sum += row * row;
    }
  }
  const double row_error_px = std::sqrt(sum / 12);
  // Noise alone gives a few hundredths; that must not loosen the prior.
  deviation *= std::max(2e-4, row_error_px * std::min(1.0, row_error_px / kClearRowError_px));
  deviation[kRowOffset] = deviation[kRoll] = 2;
  return deviation.cwiseAbs2().cwiseInverse().asDiagonal();
}

void RectificationError::update(const Calibration& calibration, const MatchNoise& noise,
                                const std::vector<PointMatch>& corrected, const std::vector<int>& inliers,
                                const Eigen::Isometry3d& motion) {
  Matrix6 motion_part = Matrix6::Zero();
  Eigen::Matrix<double, 6, kTerms> mixed_part = Eigen::Matrix<double, 6, kTerms>::Zero();
  Square own_part = Square::Zero(), row_part = Square::Zero();
  Vector6 motion_right = Vector6::Zero();
  Terms own_right = Terms::Zero(), row_right = Terms::Zero();
  double cost = 0, sum = 0;
  for (const int i : inliers) {
    const PointMatch& m = corrected[i];
    const Residual r = linearise(calibration, noise, m, motion);
    const double squared = r.value.dot(r.information * r.value);
    const double weight = cauchy_weight(squared, kCauchy2);
    // A positive term lowers both disparities; measured less predicted changes the other way as each is corrected.
    Eigen::Matrix<double, 3, kTerms> by_terms = r.by_disparity * column_basis(calibration, m.u1, m.v1).transpose();
    by_terms.row(2) -= column_basis(calibration, m.u2, m.v2).transpose();
    by_terms.noalias() -= r.by_pixel * left_basis(calibration, m.u1, m.v1);
    by_terms.topRows<2>() += left_basis(calibration, m.u2, m.v2);
    const Eigen::Matrix<double, 6, 3> weighted = weight * r.by_motion.transpose() * r.information;
    const Eigen::Matrix<double, kTerms, 3> own_weighted = weight * by_terms.transpose() * r.information;
    motion_part.noalias() += weighted * r.by_motion;
    mixed_part.noalias() += weighted * by_terms;
    own_part.noalias() += own_weighted * by_terms;
    motion_right.noalias() += weighted * r.value;
    own_right.noalias() += own_weighted * r.value;
    cost += weight * squared;
    sum += weight;
    const double row_weight = 1 / (kRowNoise_px * kRowNoise_px + m.row_error2 * m.row_error2 / 6);
    const Terms basis = row_basis(calibration, m.u2, m.v2);
    row_part.noalias() += row_weight * basis * basis.transpose();
    row_right.noalias() += row_weight * m.row_error2 * basis;
  }
  const double variance = std::max(0.1, cost / std::max(1.0, 3 * sum - 6));
  const Eigen::Matrix<double, kTerms, 6> gain = motion_part.ldlt().solve(mixed_part).transpose();
  // Normal equations of the terms themselves: a step's right side, and what the present terms already explain.
  own_part = (own_part - gain * mixed_part) / variance;
  own_right = (own_right - gain * motion_right) / variance;
  rows_.information = kMemory * rows_.information + kIndependence * row_part;
  rows_.right = kMemory * rows_.right + kIndependence * (row_right + row_part * terms_);
  residuals_.information = kMemory * residuals_.information + kIndependence * own_part;
  residuals_.right = kMemory * residuals_.right + kIndependence * (own_right + own_part * terms_);
  const Square prior = prior_information(calibration);
  const Terms terms = (rows_.information + residuals_.information + prior).ldlt().solve(rows_.right + residuals_.right);
  if (terms.allFinite()) terms_ = terms;
}

}  // namespace egosgm::odometry
