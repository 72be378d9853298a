// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "egosgm/vision/disparity_io.h"
#include "egosgm/vision/evaluation.h"

namespace egosgm::vision {

inline constexpr float kBad_px = 3.0f;
inline constexpr float kOffBy1_px = 1.0f;
inline constexpr float kBadRelative = 0.05f;

inline bool is_bad(float estimate, float truth) { return std::abs(truth - estimate) > kBad_px; }

inline bool is_d1(float estimate, float truth) {
  const float error = std::abs(truth - estimate);
  return error > kBad_px && error > kBadRelative * std::abs(truth);
}

/// One pixel that has truth; `filled` is its estimate after interpolate_background.
inline void count_pixel(float estimate, float filled, float truth, DisparityCounts& counts) {
  const bool valid = is_valid_disparity(estimate), sky = is_sky(truth);
  ++counts.truth;
  counts.sky += sky;
  counts.sky_valid += sky && valid;
  if (valid || !sky) {
    counts.bad_interpolated += !is_valid_disparity(filled) || is_bad(filled, truth);
    counts.d1_interpolated += !is_valid_disparity(filled) || is_d1(filled, truth);
  }
  if (!valid) return;
  ++counts.valid;
  counts.bad += is_bad(estimate, truth);
  counts.d1 += is_d1(estimate, truth);
  const double error_px = static_cast<double>(estimate) - truth;
  counts.bad_1px += std::abs(error_px) > kOffBy1_px;
  counts.absolute_error_px += std::abs(error_px);
  counts.signed_error_px += error_px;
}

/// NaN where there is nothing to divide by.
inline double ratio(double part, double whole) {
  return whole > 0 ? part / whole : std::numeric_limits<double>::quiet_NaN();
}
inline double percent(std::int64_t part, std::int64_t whole) {
  return ratio(100.0 * static_cast<double>(part), static_cast<double>(whole));
}

}  // namespace egosgm::vision
