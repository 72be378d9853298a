// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/pose_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "egosgm/vision/pose_evaluation.h"

namespace egosgm::vision {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;
using Rgb = std::array<int, 3>;

constexpr Rgb kInk{40, 40, 40}, kGrid{222, 222, 222}, kTruth{31, 119, 180}, kEstimate{214, 39, 40};
constexpr double kLongSide_px = 620, kLeft_px = 76, kRight_px = 24, kTop_px = 64, kBottom_px = 56;
constexpr double kNarrowest = 0.45;  // of the long side: room for the legend beside a straight path
constexpr int kTicks = 10;           // about, on the long side

struct Line {
  std::vector<cv::Point2d> points;
  Rgb color;
  double width_px;
};

enum class Anchor { kStart, kMiddle, kEnd };

struct Label {
  cv::Point2d at;  // on the baseline
  std::string text;
  Anchor anchor = Anchor::kStart;
  bool upwards = false;  // turned by 90 degrees
};

/// What both formats draw, in pixels.
struct Plot {
  cv::Size2d size;
  std::vector<Line> lines;
  std::vector<Label> labels;
};

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

/// 1, 2 or 5 times a power of ten.
double tick_step(double length, int ticks) {
  const double raw = length / ticks, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (raw <= step * power) return step * power;
  }
  return 10 * power;
}

std::string format(const char* pattern, double a, double b = 0) {
  char text[96];
  std::snprintf(text, sizeof text, pattern, a, b);
  return text;
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

void draw(const Line& line, cv::Mat& picture) {
  constexpr int kShift = 4;  // of the fixed-point coordinates
  std::vector<cv::Point> points;
  for (const auto& p : line.points) points.emplace_back(cvRound(p.x * (1 << kShift)), cvRound(p.y * (1 << kShift)));
  const cv::Scalar bgr(line.color[2], line.color[1], line.color[0]);
  cv::polylines(picture, points, false, bgr, std::max(1, cvRound(line.width_px)), cv::LINE_AA, kShift);
}

void draw(const Label& label, cv::Mat& picture) {
  constexpr double kScale = 0.42;
  int below = 0;
  const cv::Size size = cv::getTextSize(label.text, cv::FONT_HERSHEY_SIMPLEX, kScale, 1, &below);
  cv::Mat text(size.height + below + 2, size.width + 2, CV_8UC3, cv::Scalar::all(255));
  cv::putText(text, label.text, {1, size.height}, cv::FONT_HERSHEY_SIMPLEX, kScale,
              cv::Scalar(kInk[2], kInk[1], kInk[0]), 1, cv::LINE_AA);
  const double before = label.anchor == Anchor::kStart    ? 0
                        : label.anchor == Anchor::kMiddle ? size.width / 2.0
                                                          : size.width;
  cv::Point corner(cvRound(label.at.x - before), cvRound(label.at.y) - size.height);
  if (label.upwards) {
    cv::rotate(text, text, cv::ROTATE_90_COUNTERCLOCKWISE);
    corner = {cvRound(label.at.x) - size.height, cvRound(label.at.y - before)};
  }
  const cv::Rect inside = cv::Rect(corner, text.size()) & cv::Rect({0, 0}, picture.size());
  cv::Mat target = picture(inside);
  cv::min(target, text(inside - corner), target);
}

std::string svg_color(Rgb color) {
  char text[8];
  std::snprintf(text, sizeof text, "#%02x%02x%02x", color[0], color[1], color[2]);
  return text;
}

std::string svg(const Line& line) {
  std::string points;
  for (const auto& p : line.points) points += format(points.empty() ? "%.2f,%.2f" : " %.2f,%.2f", p.x, p.y);
  return "<polyline fill=\"none\" stroke=\"" + svg_color(line.color) +
         format("\" stroke-width=\"%g\" points=\"", line.width_px) + points + "\"/>\n";
}

std::string svg(const Label& label) {
  const char* anchor = label.anchor == Anchor::kStart ? "start" : label.anchor == Anchor::kMiddle ? "middle" : "end";
  const std::string turn = label.upwards ? format(" transform=\"rotate(-90 %.2f %.2f)\"", label.at.x, label.at.y) : "";
  return format("<text x=\"%.2f\" y=\"%.2f\"", label.at.x, label.at.y) + turn + " text-anchor=\"" + anchor + "\">" +
         label.text + "</text>\n";
}

}  // namespace

cv::Mat draw_path(const Poses& estimate, const Poses& truth) {
  const Plot plot = make_plot(estimate, truth);
  cv::Mat picture(cvRound(plot.size.height), cvRound(plot.size.width), CV_8UC3, cv::Scalar::all(255));
  for (const Line& line : plot.lines) draw(line, picture);
  for (const Label& label : plot.labels) draw(label, picture);
  return picture;
}

std::string path_svg(const Poses& estimate, const Poses& truth) {
  const Plot plot = make_plot(estimate, truth);
  std::string text = format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" ",
                            plot.size.width, plot.size.height) +
                     "font-family=\"sans-serif\" font-size=\"13\" fill=\"" + svg_color(kInk) + "\">\n" +
                     "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (const Line& line : plot.lines) text += svg(line);
  for (const Label& label : plot.labels) text += svg(label);
  return text + "</svg>\n";
}

}  // namespace egosgm::vision
