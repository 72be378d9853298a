// SPDX-License-Identifier: Apache-2.0
#include "host/vision/pose_plot.h"

#include <algorithm>
#include <cmath>

#include "egosgm/vision/pose_evaluation.h"
#include "host/vision/plot.h"

namespace egosgm::vision {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;

constexpr Rgb kTruth{31, 119, 180}, kEstimate{214, 39, 40};
constexpr double kLongSide_px = 620, kLeft_px = 76, kRight_px = 24, kTop_px = 64, kBottom_px = 56;
constexpr double kNarrowest = 0.45;  // of the long side: room for the legend beside a straight path
constexpr int kTicks = 10;           // about, on the long side

struct Range {
  double low, high;
  double length() const { return high - low; }
  void widen_to(double wanted) {
    const double more = std::max(0.0, wanted - length()) / 2;
    low -= more;
    high += more;
  }
};

std::vector<Eigen::Vector3d> positions(const Poses& poses) {
  std::vector<Eigen::Vector3d> positions;
  for (const auto& pose : poses) positions.push_back(poses.front().inverse() * pose.translation());
  return positions;
}

Range range_of(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b, int axis) {
  Range range{0, 0};
  for (const auto* path : {&a, &b}) {
    for (const auto& p : *path) {
      range.low = std::min(range.low, p[axis]);
      range.high = std::max(range.high, p[axis]);
    }
  }
  range.widen_to(1.06 * range.length());
  return range;
}

/// From metres to pixels.
struct Axes {
  Range x, z;
  double px_per_m;

  cv::Point2d operator()(double x_m, double z_m) const {
    return {kLeft_px + (x_m - x.low) * px_per_m, kTop_px + (z.high - z_m) * px_per_m};
  }
};

Axes make_axes(const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b) {
  Axes axes{range_of(a, b, 0), range_of(a, b, 2), 0};
  const double longest = std::max({axes.x.length(), axes.z.length(), 0.1});  // a camera that stands has a path too
  axes.x.widen_to(kNarrowest * longest);
  axes.z.widen_to(kNarrowest * longest);
  axes.px_per_m = kLongSide_px / longest;
  return axes;
}

void add_grid(const Axes& axes, Plot& plot) {
  const double step = tick_step(std::max(axes.x.length(), axes.z.length()), kTicks);
  const auto ticks_from = [step](double low) { return step * std::ceil(low / step - 1e-9); };
  const auto name = [step](double value) {
    return format(step < 1 ? "%.2g" : "%.0f", std::round(value / step) * step + 0.0);
  };
  for (double x = ticks_from(axes.x.low); x <= axes.x.high; x += step) {
    plot.lines.push_back({{axes(x, axes.z.low), axes(x, axes.z.high)}, kGrid, 1});
    plot.labels.push_back({axes(x, axes.z.low) + cv::Point2d(0, 17), name(x), Anchor::kMiddle});
  }
  for (double z = ticks_from(axes.z.low); z <= axes.z.high; z += step) {
    plot.lines.push_back({{axes(axes.x.low, z), axes(axes.x.high, z)}, kGrid, 1});
    plot.labels.push_back({axes(axes.x.low, z) + cv::Point2d(-7, 4), name(z), Anchor::kEnd});
  }
  const cv::Point2d corner = axes(axes.x.low, axes.z.low);
  plot.lines.push_back({{axes(axes.x.low, axes.z.high), corner, axes(axes.x.high, axes.z.low)}, kInk, 1});
  plot.labels.push_back(
      {axes((axes.x.low + axes.x.high) / 2, axes.z.low) + cv::Point2d(0, 40), "x [m]", Anchor::kMiddle});
  plot.labels.push_back({cv::Point2d(18, axes(0, (axes.z.low + axes.z.high) / 2).y), "z [m]", Anchor::kMiddle, true});
}

void add_path(const Axes& axes, const std::vector<Eigen::Vector3d>& path, Rgb color, double width_px, Plot& plot) {
  Line line{{}, color, width_px};
  for (const auto& p : path) line.points.push_back(axes(p.x(), p.z()));
  plot.lines.push_back(std::move(line));
}

void add_legend(const PoseEvaluation& evaluation, Plot& plot) {
  const auto entry = [&plot](double x, const char* name, Rgb color, double width_px) {
    plot.lines.push_back({{{x, 20}, {x + 26, 20}}, color, width_px});
    plot.labels.push_back({{x + 32, 24}, name});
  };
  entry(kLeft_px, "truth", kTruth, 4);
  entry(kLeft_px + 90, "estimate", kEstimate, 1.5);
  const double drift = evaluation.end_drift_percent;
  plot.labels.push_back({{kLeft_px, 46},
                         std::isfinite(drift) ? format("end drift %.2f %% of %.1f m", drift, evaluation.path_length_m)
                                              : format("end drift %.3f m", evaluation.end_drift_m)});
}

Plot make_plot(const Poses& estimate, const Poses& truth) {
  const PoseEvaluation evaluation = evaluate_poses(estimate, truth);
  const auto true_path = positions(truth), estimated_path = positions(estimate);
  const Axes axes = make_axes(true_path, estimated_path);
  Plot plot;
  plot.size = {kLeft_px + axes.x.length() * axes.px_per_m + kRight_px,
               kTop_px + axes.z.length() * axes.px_per_m + kBottom_px};
  add_grid(axes, plot);
  add_path(axes, true_path, kTruth, 4, plot);
  add_path(axes, estimated_path, kEstimate, 1.5, plot);
  add_legend(evaluation, plot);
  return plot;
}

}  // namespace

cv::Mat draw_path(const Poses& estimate, const Poses& truth) { return draw_plot(make_plot(estimate, truth)); }

std::string path_svg(const Poses& estimate, const Poses& truth) { return plot_svg(make_plot(estimate, truth)); }

}  // namespace egosgm::vision
