// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "vision/disparity_error.h"
#include "vision/disparity_figures.h"
#include "vision/image_values.h"

namespace egosgm::vision {
namespace {

void require_map(const Image& map, const char* name) {
  if (map.empty() || map.type != kF32) {
    throw InvalidArgument(std::string(name) + ": a disparity map must be float32 and not empty");
  }
}

void interpolate_row(float* row, int width) {
  int previous = -1;  // last valid pixel
  for (int x = 0; x <= width; ++x) {
    const bool at_end = x == width;
    if (!at_end && !is_valid_disparity(row[x])) continue;
    if (previous >= 0 || !at_end) {
      const float fill = previous < 0 ? row[x] : at_end ? row[previous] : std::min(row[previous], row[x]);
      std::fill(row + previous + 1, row + x, fill);
    }
    previous = x;
  }
}

void extend_columns(Image& map) {
  for (int x = 0; x < map.cols; ++x) {
    int top = 0, bottom = map.rows - 1;
    while (top < map.rows && !is_valid_disparity(map.at<float>(top, x))) ++top;
    if (top == map.rows) continue;
    while (!is_valid_disparity(map.at<float>(bottom, x))) --bottom;
    for (int y = 0; y < top; ++y) map.at<float>(y, x) = map.at<float>(top, x);
    for (int y = bottom + 1; y < map.rows; ++y) map.at<float>(y, x) = map.at<float>(bottom, x);
  }
}

/// The mean of the values that are not NaN.
class Mean {
 public:
  void add(double value) {
    if (std::isnan(value)) return;
    sum_ += value;
    ++count_;
  }
  double value() const { return count_ > 0 ? sum_ / count_ : std::numeric_limits<double>::quiet_NaN(); }

 private:
  double sum_ = 0;
  int count_ = 0;
};

}  // namespace

DisparityCounts& DisparityCounts::operator+=(const DisparityCounts& other) {
  for_each_count([&](auto, auto count, auto) { this->*count += other.*count; });
  return *this;
}

DisparityCounts compare_disparity(const Image& estimate, const Image& truth) {
  require_map(estimate, "estimate");
  require_map(truth, "truth");
  if (estimate.size() != truth.size()) {
    throw InvalidArgument("the estimate has " + std::to_string(estimate.cols) + "x" + std::to_string(estimate.rows) +
                          " pixels, its truth " + std::to_string(truth.cols) + "x" + std::to_string(truth.rows) +
                          "; give maps of one size");
  }
  const Image interpolated = interpolate_background(estimate);
  DisparityCounts counts;
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const float t = truth.at<float>(y, x);
      if (!is_valid_disparity(t)) continue;
      count_pixel(estimate.at<float>(y, x), interpolated.at<float>(y, x), t, counts);
    }
  }
  return counts;
}

DisparityMetrics metrics_of(const DisparityCounts& counts) {
  const std::int64_t surfaces = counts.truth - counts.sky, seen = counts.valid - counts.sky_valid;
  const std::int64_t missing = surfaces - seen;
  return {.bad_or_missing = percent(counts.bad + missing, counts.truth),
          .bad_1px = percent(counts.bad_1px + missing, counts.truth),
          .bad_of_valid = percent(counts.bad, counts.valid),
          .density = percent(seen, surfaces),
          .interpolated = percent(counts.bad_interpolated, counts.truth),
          .d1 = percent(counts.d1 + missing, counts.truth),
          .d1_interpolated = percent(counts.d1_interpolated, counts.truth),
          .mae_px = ratio(counts.absolute_error_px, static_cast<double>(counts.valid)),
          .mean_error_px = ratio(counts.signed_error_px, static_cast<double>(counts.valid)),
          .filled = percent(counts.valid, counts.truth),
          .wrong_of_all = percent(counts.bad, counts.truth)};
}

DisparityMetrics mean_of(const std::vector<DisparityMetrics>& images) {
  DisparityMetrics means;
  for_each_metric([&](auto, auto metric, auto) {
    Mean mean;
    for (const DisparityMetrics& image : images) mean.add(image.*metric);
    means.*metric = mean.value();
  });
  return means;
}

Image interpolate_background(const Image& disparity) {
  require_map(disparity, "interpolate_background");
  Image filled = disparity.clone();
  for (int y = 0; y < filled.rows; ++y) interpolate_row(filled.row<float>(y), filled.cols);
  extend_columns(filled);
  return filled;
}

Image drop_uncertain(const Image& disparity, const Image& variance, float max_variance_px2) {
  require_map(disparity, "drop_uncertain");
  require_map(variance, "drop_uncertain");
  if (disparity.size() != variance.size()) {
    throw InvalidArgument("drop_uncertain: disparity and variance differ in size");
  }
  Image certain = disparity.clone();
  set_where(certain, kInvalidDisparity, variance, [&](auto value) { return value > max_variance_px2; });
  return certain;
}

}  // namespace egosgm::vision
