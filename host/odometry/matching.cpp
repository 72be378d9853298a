// SPDX-License-Identifier: Apache-2.0
#include "host/odometry/matching.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "host/cpu_clones.h"
#include "host/odometry/subpixel.h"

namespace egosgm::odometry {
namespace {

constexpr int kMaxDistance = 20 * kDescriptorSize;  // of descriptors; unrelated ones differ by 34 a sample
constexpr int kStereoRows_px = 2;                   // rectification error
constexpr int kBeyondInfinity_px = 2;               // and in the direction of the search
constexpr float kFarthestDisparity_px = -1;         // noise and rectification error at infinity
constexpr float kMinCorrelation = 0.5f;
constexpr float kMaxRowError_px = 2.5f;

struct Box {
  int x0, x1, y0, y1;  // inclusive
};

EGOSGM_CPU_CLONES
int best_match(const FeatureSet& set, int feature_class, const Descriptor& descriptor, const Box& box) {
  int best = kNoMatch, least = kMaxDistance;
  const int first_row = std::max(box.y0, 0), last_row = std::min(box.y1, set.height - 1);
  if (first_row > last_row) return best;
  const int end = set.first_of_row(feature_class, last_row + 1);
  for (int first = set.first_of_row(feature_class, first_row); first < end; first += 64) {
    std::uint64_t inside = 0;  // a bit each: no branch can tell beforehand
    const int count = std::min(end - first, 64);
    for (int i = 0; i < count; ++i) {
      const int x = set.features[first + i].x;
      inside |= static_cast<std::uint64_t>((x >= box.x0) & (x <= box.x1)) << i;
    }
    for (; inside != 0; inside &= inside - 1) {
      const int k = first + std::countr_zero(inside);
      const int distance = descriptor_distance(set.descriptors[k], descriptor);
      if (distance >= least) continue;
      least = distance;
      best = k;
    }
  }
  return best;
}

Box around(double x, double y, const SearchWindow& window) {
  return {static_cast<int>(std::ceil(x - window.x_px)), static_cast<int>(std::floor(x + window.x_px)),
          static_cast<int>(std::ceil(y - window.y_px)), static_cast<int>(std::floor(y + window.y_px))};
}

int match_to_left(TrackedFrame& frame, int right, const StereoWindow& window) {
  int& known = frame.left_of_right[right];
  if (known == kUnknown) {
    const Feature& f = frame.right_features.features[right];
    known =
        best_match(frame.left_features, frame.right_features.classes[right], frame.right_features.descriptors[right],
                   {f.x + window.least_px, f.x + window.most_px, f.y - kStereoRows_px, f.y + kStereoRows_px});
  }
  return known;
}

// The shift of a static point's two images.
struct Flow {
  double left_x, right_x, y;
};

Flow predict_flow(const Calibration& c, const Eigen::Isometry3d& motion, double x, double y, double disparity) {
  const double d = std::max(disparity + c.doffs_px, 0.5);
  const double z = c.fx * c.baseline_m / d;
  const Eigen::Vector3d p = motion * Eigen::Vector3d((x - c.cx) * z / c.fx, (y - c.cy) * z / c.fy, z);
  if (p.z() < 0.1) return {1e6, 1e6, 1e6};
  const double u = c.fx * p.x() / p.z() + c.cx, v = c.fy * p.y() / p.z() + c.cy;
  return {u - x, u - x - (c.fx * c.baseline_m / p.z() - d), v - y};
}

// The disparity of left feature `i` at its refined place.
float refined_disparity(TrackedFrame& frame, int i) {
  float& disparity = frame.disparity[i];
  if (!is_untried(disparity)) return disparity;
  disparity = kCannot;
  const Feature& left = frame.left_features.features[i];
  const Feature& right = frame.right_features.features[frame.right_of_left[i]];
  Patch patch;
  if (!make_patch(frame.left, frame.u[i], frame.v[i], 1.0f, patch)) return disparity;
  float x = frame.u[i] - (left.x - right.x), y = frame.v[i] + (right.y - left.y);
  if (!align_patch(patch, frame.right, kMinCorrelation, x, y)) return disparity;
  if (std::abs(y - frame.v[i]) > kMaxRowError_px) return disparity;
  disparity = frame.u[i] - x;
  frame.row_error[i] = y - frame.v[i];
  return disparity;
}

}  // namespace

void TrackedFrame::reset_matches() {
  const int count = left_features.size();
  right_of_left.assign(count, kUnknown);
  left_of_right.assign(right_features.size(), kUnknown);
  disparity.assign(count, kUntried);
  row_error.assign(count, 0);
  age.assign(count, 0);
  u.resize(count);
  v.resize(count);
  for (int i = 0; i < count; ++i) {
    u[i] = left_features.features[i].x;
    v[i] = left_features.features[i].y;
  }
}

int stereo_match(TrackedFrame& frame, int i, const StereoWindow& window) {
  int& known = frame.right_of_left[i];
  if (known == kUnknown) {
    const Feature& f = frame.left_features.features[i];
    known = best_match(frame.right_features, frame.left_features.classes[i], frame.left_features.descriptors[i],
                       {f.x - window.most_px, f.x - window.least_px, f.y - kStereoRows_px, f.y + kStereoRows_px});
    if (known != kNoMatch && match_to_left(frame, known, window) != i) known = kNoMatch;
  }
  return known;
}

std::vector<CircularMatch> match_circle(const Calibration& calibration, TrackedFrame& previous, TrackedFrame& current,
                                        const std::vector<int>& queries, const Eigen::Isometry3d* motion,
                                        const SearchWindow& window, int max_disparity_px) {
  const int infinity_px = static_cast<int>(std::lround(std::clamp(-calibration.doffs_px, -1e6, 1e6)));
  const StereoWindow stereo{infinity_px - kBeyondInfinity_px, infinity_px + max_disparity_px};
  std::vector<CircularMatch> matches;
  matches.reserve(queries.size());
  for (const int i : queries) {
    const int previous_right = stereo_match(previous, i, stereo);
    if (previous_right == kNoMatch) continue;
    const Feature& left = previous.left_features.features[i];
    const int feature_class = previous.left_features.classes[i];
    const double disparity = left.x - previous.right_features.features[previous_right].x;
    const Flow flow = motion ? predict_flow(calibration, *motion, left.x, left.y, disparity) : Flow{0, 0, 0};
    if (std::abs(flow.left_x) > current.left.width || std::abs(flow.y) > current.left.height) continue;
    const int j = best_match(current.left_features, feature_class, previous.left_features.descriptors[i],
                             around(left.x + flow.left_x, left.y + flow.y, window));
    if (j == kNoMatch) continue;
    const int current_right = stereo_match(current, j, stereo);
    if (current_right == kNoMatch) continue;
    const Feature& right = current.right_features.features[current_right];
    const int back =
        best_match(previous.right_features, feature_class, current.right_features.descriptors[current_right],
                   around(right.x - flow.right_x, right.y - flow.y, window));
    if (back == previous_right) matches.push_back({i, j, current_right, previous_right});
  }
  return matches;
}

std::vector<int> select_spread(const TrackedFrame& frame, int cell_px, int per_cell) {
  const int columns = (frame.left.width + cell_px - 1) / cell_px, rows = (frame.left.height + cell_px - 1) / cell_px;
  std::vector<std::vector<int>> cells(static_cast<std::size_t>(columns) * rows);
  const auto& features = frame.left_features.features;
  for (int i = 0; i < frame.left_features.size(); ++i) {
    cells[(features[i].y / cell_px) * columns + features[i].x / cell_px].push_back(i);
  }
  const auto before = [&](int a, int b) {
    if (frame.age[a] != frame.age[b]) return frame.age[a] > frame.age[b];
    if (features[a].strength != features[b].strength) return features[a].strength > features[b].strength;
    return a < b;
  };
  std::vector<int> selected;
  for (auto& cell : cells) {
    const std::size_t count = std::min<std::size_t>(per_cell, cell.size());
    std::nth_element(cell.begin(), cell.begin() + count, cell.end(), before);
    selected.insert(selected.end(), cell.begin(), cell.begin() + count);
  }
  std::sort(selected.begin(), selected.end());
  return selected;
}

std::vector<PointMatch> refine_matches(const Calibration& calibration, TrackedFrame& previous, TrackedFrame& current,
                                       const std::vector<CircularMatch>& matches, const Eigen::Isometry3d& motion,
                                       std::vector<CircularMatch>& kept) {
  std::vector<PointMatch> points;
  points.reserve(matches.size());
  kept.clear();
  for (const CircularMatch& match : matches) {
    const int i = match.previous_left, j = match.current_left;
    const float d1 = refined_disparity(previous, i);
    if (d1 == kCannot || d1 + calibration.doffs_px < kFarthestDisparity_px) continue;
    const Feature& feature = current.left_features.features[j];
    // A patch looks larger by the ratio of its depths, that is, of its disparities.
    const Eigen::Vector3d before = triangulate(calibration, previous.u[i], previous.v[i], d1);
    const Eigen::Vector3d after = motion * before;
    // In this order, what is not a number becomes one: a calibration may be anything that is finite.
    const double scale = std::max(0.5, std::min(2.0, before.z() / std::max(kMinDepth_m, after.z())));
    Patch patch;
    if (!make_patch(previous.left, previous.u[i], previous.v[i], static_cast<float>(scale), patch)) continue;
    float u = feature.x, v = feature.y;
    if (!align_patch(patch, current.left, kMinCorrelation, u, v)) continue;
    current.u[j] = u;
    current.v[j] = v;
    current.disparity[j] = kUntried;
    current.right_of_left[j] = match.current_right;
    const float d2 = refined_disparity(current, j);
    if (d2 == kCannot) continue;
    points.push_back({previous.u[i], previous.v[i], d1, u, v, d2, current.row_error[j]});
    kept.push_back(match);
  }
  return points;
}

std::vector<PointMatch> pixel_matches(const TrackedFrame& previous, const TrackedFrame& current,
                                      const std::vector<CircularMatch>& matches) {
  std::vector<PointMatch> points;
  points.reserve(matches.size());
  for (const CircularMatch& match : matches) {
    const Feature& a = previous.left_features.features[match.previous_left];
    const Feature& b = current.left_features.features[match.current_left];
    points.push_back({static_cast<double>(a.x), static_cast<double>(a.y),
                      static_cast<double>(a.x - previous.right_features.features[match.previous_right].x),
                      static_cast<double>(b.x), static_cast<double>(b.y),
                      static_cast<double>(b.x - current.right_features.features[match.current_right].x), 0});
  }
  return points;
}

}  // namespace egosgm::odometry
