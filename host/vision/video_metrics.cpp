// SPDX-License-Identifier: Apache-2.0
#include "host/vision/video_metrics.h"

#include <algorithm>
#include <bit>
#include <opencv2/imgproc.hpp>

#include "egosgm/error.h"
#include "egosgm/reason.h"
#include "egosgm/vision/disparity_io.h"
#include "host/vision/disparity_error.h"

namespace egosgm::vision {
namespace {

constexpr double kHidden_px = 1.0;       // nearer than expected by more than this: something else is in front
constexpr double kTinyChange_px = 1e-3;  // CODD's, against division by zero
constexpr float kEdge_px = 3.0f;         // a jump between neighbours
constexpr int kEdgeReach = 3;            // pixels around it
constexpr float kLargestFlow_px = 250.0f;
constexpr double kLeastLikeness = 0.01, kLikenessPerDifference = 50.0;  // NVDS: exp(-50 |I - I'|) > 0.01

constexpr std::uint8_t bit_of(Region region) { return static_cast<std::uint8_t>(1U << static_cast<unsigned>(region)); }

bool is_set(const cv::Mat& mask, int y, int x) { return !mask.empty() && mask.at<std::uint8_t>(y, x) != 0; }

bool has(const cv::Mat& map, int y, int x) { return is_valid_disparity(map.at<float>(y, x)); }

double at(const cv::Mat& map, int y, int x) { return map.at<float>(y, x); }

/// Adds the error of the pixel that moves from (x, y) to (to_x, to_y); `next_truth`: of the same point.
void add_along_motion(const VideoFrame& before, const VideoFrame& now, cv::Point from, cv::Point to, double next_truth,
                      TemporalCounts& counts) {
  if (!has(before.estimate, from.y, from.x) || !has(now.estimate, to.y, to.x)) return;
  add_change_error(at(now.estimate, to.y, to.x) - at(before.estimate, from.y, from.x),
                   next_truth - at(before.truth, from.y, from.x), counts);
}

/// The four pixels around a place and their weights.
struct Sample {
  int x = 0, y = 0;
  double right = 0, down = 0;

  /// False where the place is outside of the image.
  bool place(double at_x, double at_y, cv::Size size) {
    if (!(at_x >= 0 && at_y >= 0 && at_x <= size.width - 1 && at_y <= size.height - 1)) return false;
    x = std::min(static_cast<int>(at_x), std::max(size.width - 2, 0));
    y = std::min(static_cast<int>(at_y), std::max(size.height - 2, 0));
    right = at_x - x;
    down = at_y - y;
    return true;
  }

  /// `value(y, x)` interpolated; a pixel without weight is not asked. False where a pixel has none.
  template <typename Value>
  bool operator()(const Value& value, double& result) const {
    result = 0;
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const double weight = (dx ? right : 1 - right) * (dy ? down : 1 - down);
        double v = 0;
        if (weight == 0) continue;
        if (!value(y + dy, x + dx, v)) return false;
        result += weight * v;
      }
    }
    return true;
  }
};

/// 0..1.
double brightness(const cv::Mat& image, int y, int x) {
  return image.depth() == CV_8U ? image.at<std::uint8_t>(y, x) / 255.0 : image.at<std::uint16_t>(y, x) / 65535.0;
}

/// NVDS' mask: what looks alike, as three equal channels of colour.
bool looks_alike(const VideoFrame& before, const VideoFrame& now, int y, int x, const Sample& sample) {
  if (before.image.empty() || now.image.empty()) return true;
  double there = 0;
  sample([&](int row, int column, double& v) { return v = brightness(now.image, row, column), true; }, there);
  const double difference = std::sqrt(3.0) * std::abs(there - brightness(before.image, y, x));
  return std::exp(-kLikenessPerDifference * difference) > kLeastLikeness;
}

/// Sums over a pair.
struct FlowSums {
  std::int64_t pixels = 0, alike_1_01 = 0, alike_1_25 = 0;
  double difference = 0;

  void add(double a, double b) {
    const double larger = std::max(a / b, b / a);
    ++pixels;
    alike_1_01 += larger < 1.01;
    alike_1_25 += larger < 1.25;
    difference += std::abs(a - b);
  }
};

/// Mean and shares along the flow of a quantity that `value(map, y, x, v)` gives.
template <typename Value>
FlowSums sum_along_flow(const VideoFrame& before, const VideoFrame& now, const Value& value) {
  FlowSums sums;
  for (int y = 0; y < before.estimate.rows; ++y) {
    for (int x = 0; x < before.estimate.cols; ++x) {
      const cv::Vec2f flow = before.flow_to_next.at<cv::Vec2f>(y, x);
      if (!(std::abs(flow[0]) <= kLargestFlow_px && std::abs(flow[1]) <= kLargestFlow_px)) continue;
      double here = 0, there = 0;
      Sample sample;
      if (!value(before.estimate, y, x, here)) continue;
      if (!sample.place(static_cast<double>(x) + flow[0], static_cast<double>(y) + flow[1], now.estimate.size())) {
        continue;
      }
      if (!sample([&](int row, int column, double& v) { return value(now.estimate, row, column, v); }, there)) continue;
      if (looks_alike(before, now, y, x, sample)) sums.add(here, there);
    }
  }
  return sums;
}

PairMean mean_of_pair(double sum, std::int64_t pixels) {
  return pixels > 0 ? PairMean{sum / static_cast<double>(pixels), 1} : PairMean{};
}

/// The bits of a float in the order of its values.
std::uint32_t ordered_bits(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value + 0.0f);
  return bits & 0x80000000U ? ~bits : bits | 0x80000000U;
}

/// Sorts by value; equal ones stay in the order of rows and columns. Gives the places.
std::vector<std::uint32_t> order_of(const std::vector<float>& values) {
  std::vector<std::uint64_t> keys(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) keys[i] = std::uint64_t{ordered_bits(values[i])} << 32 | i;
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order(values.size());
  std::transform(keys.begin(), keys.end(), order.begin(),
                 [](std::uint64_t key) { return static_cast<std::uint32_t>(key); });
  return order;
}

std::int64_t rounded_percent(std::int64_t whole, int percents) { return (whole * percents + 50) / 100; }

/// A pixel is beside an edge if a jump between two neighbours with truth is near.
cv::Mat find_edges(const cv::Mat& truth) {
  cv::Mat edges(truth.size(), CV_8UC1, cv::Scalar(0));
  const auto look = [&](int y, int x, int other_y, int other_x) {
    if (!has(truth, y, x) || !has(truth, other_y, other_x)) return;
    if (std::abs(truth.at<float>(y, x) - truth.at<float>(other_y, other_x)) <= kEdge_px) return;
    edges.at<std::uint8_t>(y, x) = edges.at<std::uint8_t>(other_y, other_x) = 255;
  };
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      if (x + 1 < truth.cols) look(y, x, y, x + 1);
      if (y + 1 < truth.rows) look(y, x, y + 1, x);
    }
  }
  cv::dilate(edges, edges, cv::Mat::ones(2 * kEdgeReach + 1, 2 * kEdgeReach + 1, CV_8UC1));
  return edges;
}

}  // namespace

PixelMotion::PixelMotion(const Calibration& calibration, const Eigen::Isometry3d& target_from_source, cv::Size size)
    : fx_(calibration.fx),
      fy_(calibration.fy),
      cx_(calibration.cx),
      cy_(calibration.cy),
      baseline_m_(calibration.baseline_m),
      doffs_px_(calibration.doffs_px),
      rotation_(target_from_source.linear()),
      translation_(target_from_source.translation()),
      size_(size) {}

cv::Mat move_map(const cv::Mat& disparity, const Calibration& calibration,
                 const Eigen::Isometry3d& current_from_previous) {
  if (disparity.empty() || disparity.type() != CV_32FC1) {
    throw InvalidArgument("move_map: a disparity map must be CV_32FC1 and not empty");
  }
  const PixelMotion motion(calibration, current_from_previous, disparity.size());
  cv::Mat moved(disparity.size(), CV_32FC1, cv::Scalar(kInvalidDisparity));
  MovedPixel pixel;
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      if (!has(disparity, y, x) || !motion(x, y, at(disparity, y, x), pixel)) continue;
      float& there = moved.at<float>(pixel.y, pixel.x);
      there = std::max(there, static_cast<float>(pixel.disparity));
    }
  }
  return moved;
}

TemporalCounts count_flicker(const cv::Mat& estimate, const cv::Mat& moved) {
  TemporalCounts counts;
  for (int y = 0; y < estimate.rows; ++y) {
    for (int x = 0; x < estimate.cols; ++x) {
      if (has(estimate, y, x) && has(moved, y, x)) add_change_error(at(estimate, y, x), at(moved, y, x), counts);
    }
  }
  end_pair(counts);
  return counts;
}

PairMean temporal_alignment_error(const cv::Mat& estimate, const cv::Mat& moved, double doffs_px) {
  double sum = 0;
  std::int64_t pixels = 0;
  for (int y = 0; y < estimate.rows; ++y) {
    for (int x = 0; x < estimate.cols; ++x) {
      if (!has(estimate, y, x) || !has(moved, y, x) || !(at(estimate, y, x) + doffs_px > 0)) continue;
      // Depths are f b / (disparity + doffs): f b cancels.
      sum += std::abs(1 - (at(estimate, y, x) + doffs_px) / (at(moved, y, x) + doffs_px));
      ++pixels;
    }
  }
  return mean_of_pair(100 * sum, pixels);
}

void add_change_error(double estimated_change, double true_change, TemporalCounts& counts) {
  const double error = std::abs(estimated_change - true_change);
  const double relative = error / (std::abs(true_change) + kTinyChange_px);
  counts.sum_px += error;
  counts.relative_sum += relative;
  ++counts.pixels;
  counts.above_1px += error > 1;
  counts.above_3px += error > 3;
  counts.relative_above_1 += relative > 1;
}

void end_pair(TemporalCounts& counts) {
  if (counts.pixels == 0) return;
  counts.sum_of_pair_means_px = counts.sum_px / static_cast<double>(counts.pixels);
  counts.pairs = 1;
}

TemporalCounts tepe_along_flow(const VideoFrame& before, const VideoFrame& now) {
  TemporalCounts counts;
  const cv::Rect image({0, 0}, before.truth.size());
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const cv::Vec2f flow = before.flow_to_next.at<cv::Vec2f>(y, x);
      if (!has(before.truth, y, x) || !std::isfinite(flow[0]) || !std::isfinite(flow[1])) continue;
      const double to_x = std::nearbyint(static_cast<double>(x) + flow[0]);
      const double to_y = std::nearbyint(static_cast<double>(y) + flow[1]);
      if (!(to_x >= 0 && to_x < image.width && to_y >= 0 && to_y < image.height)) continue;
      const cv::Point to(static_cast<int>(to_x), static_cast<int>(to_y));
      const float next = !before.next_truth.empty() ? before.next_truth.at<float>(y, x)
                         : !now.truth.empty()       ? now.truth.at<float>(to)
                                                    : kInvalidDisparity;
      if (is_valid_disparity(next)) add_along_motion(before, now, {x, y}, to, next, counts);
    }
  }
  end_pair(counts);
  return counts;
}

TemporalCounts tepe_along_poses(const VideoFrame& before, const VideoFrame& now, const PixelMotion& now_from_before) {
  TemporalCounts counts;
  MovedPixel moved;
  for (int y = 0; y < before.truth.rows; ++y) {
    for (int x = 0; x < before.truth.cols; ++x) {
      if (!has(before.truth, y, x) || is_set(before.moving, y, x)) continue;
      if (!now_from_before(x, y, at(before.truth, y, x), moved) || !has(now.truth, moved.y, moved.x)) continue;
      const double next = at(now.truth, moved.y, moved.x);
      if (is_set(now.moving, moved.y, moved.x) || std::abs(next - moved.disparity) > kHidden_px) continue;
      add_along_motion(before, now, {x, y}, {moved.x, moved.y}, next, counts);
    }
  }
  end_pair(counts);
  return counts;
}

void add_flow_figures(const VideoFrame& before, const VideoFrame& now, const std::optional<Calibration>& calibration,
                      VideoCounts& counts) {
  FlowSums sums = sum_along_flow(before, now, [](const cv::Mat& map, int y, int x, double& v) {
    v = at(map, y, x);
    return is_valid_disparity(map.at<float>(y, x)) && v > 0;
  });
  counts.opw_px += mean_of_pair(sums.difference, sums.pixels);
  if (calibration) {
    const double depth_px = calibration->fx * calibration->baseline_m, doffs_px = calibration->doffs_px;
    sums = sum_along_flow(before, now, [&](const cv::Mat& map, int y, int x, double& v) {
      v = depth_px / (at(map, y, x) + doffs_px);
      return is_valid_disparity(map.at<float>(y, x)) && std::isfinite(v) && v > 0;
    });
    counts.opw_m += mean_of_pair(sums.difference, sums.pixels);
  }
  counts.rtc_1_01_percent += mean_of_pair(100.0 * static_cast<double>(sums.alike_1_01), sums.pixels);
  counts.rtc_1_25_percent += mean_of_pair(100.0 * static_cast<double>(sums.alike_1_25), sums.pixels);
}

void add_change(float estimate, float against, float truth, ChangeCounts& counts) {
  const bool has = is_valid_disparity(estimate), had = is_valid_disparity(against);
  ++counts.truth;
  counts.gained += has && !had;
  counts.gained_right += has && !had && is_right(estimate, truth);
  counts.lost_right += had && is_right(against, truth) && !is_right(estimate, truth);
  if (!has || !had) return;
  ++counts.both;
  const double e = estimate, a = against, t = truth;
  if (!(std::abs(e - a) > 1)) return;
  ++counts.changed;
  counts.worse += std::abs(e - t) > std::abs(a - t);
  counts.better += std::abs(e - t) < std::abs(a - t);
}

void add_trust(float estimate, float truth, std::uint8_t reason, TrustCounts& counts) {
  if (!is_valid_disparity(estimate)) return;
  const bool bad = is_bad(estimate, truth), trusted = reason == static_cast<std::uint8_t>(Reason::kTrusted);
  ++counts.valid;
  counts.bad += bad;
  counts.trusted += trusted;
  counts.trusted_bad += trusted && bad;
}

DensityCounts count_density(const VideoFrame& frame) {
  DensityCounts counts;
  std::vector<float> uncertainties, errors;
  for (int y = 0; y < frame.truth.rows; ++y) {
    for (int x = 0; x < frame.truth.cols; ++x) {
      if (!has(frame.truth, y, x)) continue;
      ++counts.truth;
      const float uncertainty = frame.uncertainty.at<float>(y, x);
      if (!has(frame.estimate, y, x) || !std::isfinite(uncertainty)) continue;
      uncertainties.push_back(uncertainty);
      errors.push_back(std::abs(frame.truth.at<float>(y, x) - frame.estimate.at<float>(y, x)));
    }
  }
  const auto pixels = static_cast<std::int64_t>(errors.size());
  const auto bad_of = [&](std::uint32_t i) { return errors[i] > kBad_px; };
  const auto fill = [&](const std::vector<std::uint32_t>& order, auto& bad, auto& error_px) {
    std::int64_t next = 0, bad_so_far = 0;
    double error_so_far = 0;
    for (int k = 0; k < DensityCounts::kShares; ++k) {
      counts.kept[k] = rounded_percent(pixels, 2 * (k + 1));
      for (; next < counts.kept[k]; ++next) {
        bad_so_far += bad_of(order[next]);
        error_so_far += errors[order[next]];
      }
      bad[k] = bad_so_far;
      error_px[k] = error_so_far;
    }
  };
  const std::vector<std::uint32_t> order = order_of(uncertainties);
  fill(order, counts.bad, counts.error_px);
  fill(order_of(errors), counts.oracle_bad, counts.oracle_error_px);
  for (int k = 0; k < DensityCounts::kDensities; ++k) {
    counts.kept_of_truth[k] = std::min(rounded_percent(counts.truth, 50 + 5 * k), pixels);
    counts.bad_of_kept[k] = std::count_if(order.begin(), order.begin() + counts.kept_of_truth[k], bad_of);
  }
  return counts;
}

cv::Mat find_regions(const VideoFrame& now, const VideoFrame* before, const Calibration* calibration,
                     const Eigen::Isometry3d* motion, float near_px) {
  const cv::Mat& all = now.all_truth.empty() ? now.truth : now.all_truth;
  const cv::Mat edges = find_edges(all);
  cv::Mat all_before;
  std::optional<PixelMotion> back;
  if (before && calibration && motion) {
    all_before = before->all_truth.empty() ? before->truth : before->all_truth;
    if (!all_before.empty()) back.emplace(*calibration, motion->inverse(), all.size());
  }
  cv::Mat regions(now.truth.size(), CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < regions.rows; ++y) {
    for (int x = 0; x < regions.cols; ++x) {
      if (!has(now.truth, y, x)) continue;
      const float truth = now.truth.at<float>(y, x);
      std::uint8_t bits = bit_of(Region::kAll) | bit_of(truth >= near_px ? Region::kNear : Region::kFar);
      if (is_sky(truth)) bits |= bit_of(Region::kSky);
      if (edges.at<std::uint8_t>(y, x)) bits |= bit_of(Region::kEdges);
      if (!now.moving.empty()) bits |= bit_of(is_set(now.moving, y, x) ? Region::kMoving : Region::kStill);
      if (back && !is_set(now.moving, y, x)) {
        MovedPixel then;
        const bool in_sight = (*back)(x, y, truth, then);
        if (!in_sight ||
            (has(all_before, then.y, then.x) && at(all_before, then.y, then.x) > then.disparity + kHidden_px)) {
          bits |= bit_of(Region::kUncovered);
        }
      }
      regions.at<std::uint8_t>(y, x) = bits;
    }
  }
  return regions;
}

}  // namespace egosgm::vision
