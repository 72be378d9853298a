// SPDX-License-Identifier: Apache-2.0
#include "host/vision/video_plot.h"

#include <algorithm>
#include <cmath>

#include "egosgm/error.h"
#include "host/vision/disparity_error.h"
#include "host/vision/plot.h"

namespace egosgm::vision {
namespace {

constexpr double kWidth_px = 620, kHeight_px = 300, kLeft_px = 62, kRight_px = 20, kTop_px = 56, kBottom_px = 52;
constexpr double kLegend_px = 160;  // a name's room
constexpr Rgb kColors[] = {{214, 39, 40}, {31, 119, 180}, {44, 160, 44}, {148, 103, 189}};

struct Curve {
  const char* name;
  std::vector<cv::Point2d> points;  // NaN in y: a gap
};

struct Chart {
  std::string x_name, y_name;
  double x_low = 0, x_high = 1;
  std::vector<Curve> curves;
};

/// From values to pixels; y begins at 0.
struct ChartAxes {
  double x_low, x_high, y_high;

  cv::Point2d operator()(double x, double y) const {
    return {kLeft_px + (x - x_low) / (x_high - x_low) * kWidth_px, kTop_px + (1 - y / y_high) * kHeight_px};
  }
};

double highest(const Chart& chart) {
  double high = 0;
  for (const Curve& curve : chart.curves) {
    for (const auto& p : curve.points) high = std::max(high, std::isnan(p.y) ? 0 : p.y);
  }
  return high > 0 ? 1.05 * high : 1;
}

std::string tick_name(double value, double step) {
  return format(step < 0.1 ? "%.2f" : step < 1 ? "%.1f" : "%.0f", value);
}

void add_grid(const Chart& chart, const ChartAxes& axes, Plot& plot) {
  const double x_step = std::max(tick_step(axes.x_high - axes.x_low, 10), 1.0), y_step = tick_step(axes.y_high, 6);
  for (double x = x_step * std::ceil(axes.x_low / x_step); x <= axes.x_high; x += x_step) {
    plot.lines.push_back({{axes(x, 0), axes(x, axes.y_high)}, kGrid, 1});
    plot.labels.push_back({axes(x, 0) + cv::Point2d(0, 17), tick_name(x, x_step), Anchor::kMiddle});
  }
  for (double y = 0; y <= axes.y_high; y += y_step) {
    plot.lines.push_back({{axes(axes.x_low, y), axes(axes.x_high, y)}, kGrid, 1});
    plot.labels.push_back({axes(axes.x_low, y) + cv::Point2d(-7, 4), tick_name(y, y_step), Anchor::kEnd});
  }
  plot.lines.push_back({{axes(axes.x_low, axes.y_high), axes(axes.x_low, 0), axes(axes.x_high, 0)}, kInk, 1});
  plot.labels.push_back({axes((axes.x_low + axes.x_high) / 2, 0) + cv::Point2d(0, 40), chart.x_name, Anchor::kMiddle});
  plot.labels.push_back({{16, axes(0, axes.y_high / 2).y}, chart.y_name, Anchor::kMiddle, true});
}

/// A line for each piece without a gap; a lone point becomes a short dash.
void add_curve(const Curve& curve, const ChartAxes& axes, Rgb color, Plot& plot) {
  std::vector<cv::Point2d> piece;
  const auto end_piece = [&] {
    if (piece.size() == 1) piece = {piece[0] - cv::Point2d(2, 0), piece[0] + cv::Point2d(2, 0)};
    if (!piece.empty()) plot.lines.push_back({piece, color, 1.8});
    piece.clear();
  };
  for (const auto& p : curve.points) {
    if (std::isnan(p.y)) {
      end_piece();
    } else {
      piece.push_back(axes(p.x, p.y));
    }
  }
  end_piece();
}

Plot make_plot(const Chart& chart) {
  const ChartAxes axes{chart.x_low, chart.x_high, highest(chart)};
  Plot plot;
  plot.size = {kLeft_px + kWidth_px + kRight_px, kTop_px + kHeight_px + kBottom_px};
  add_grid(chart, axes, plot);
  double at = kLeft_px;
  for (std::size_t i = 0; i < chart.curves.size(); ++i, at += kLegend_px) {
    add_curve(chart.curves[i], axes, kColors[i], plot);
    plot.lines.push_back({{{at, 26}, {at + 22, 26}}, kColors[i], 1.8});
    plot.labels.push_back({{at + 28, 30}, chart.curves[i].name});
  }
  return plot;
}

double mean_px(const TemporalCounts& counts) { return ratio(counts.sum_px, static_cast<double>(counts.pixels)); }

Plot plot_over_frames(const std::vector<VideoCounts>& frames) {
  if (frames.size() < 2) throw InvalidArgument("a plot over frames needs at least two of them");
  Chart chart{"frame, counted from the first one", "px", 0, static_cast<double>(frames.size() - 1), {}};
  const auto add = [&](const char* name, auto&& figure) {
    Curve curve{name, {}};
    for (std::size_t i = 0; i < frames.size(); ++i)
      curve.points.emplace_back(static_cast<double>(i), figure(frames[i]));
    const bool known =
        std::any_of(curve.points.begin(), curve.points.end(), [](const auto& p) { return !std::isnan(p.y); });
    if (known) chart.curves.push_back(std::move(curve));
  };
  add("flicker", [](const VideoCounts& c) { return mean_px(c.flicker); });
  add("TEPE same pixel", [](const VideoCounts& c) { return mean_px(c.region(Region::kAll).tepe); });
  add("TEPE along motion", [](const VideoCounts& c) { return mean_px(c.tepe_along_motion); });
  add("absolute error", [](const VideoCounts& c) { return metrics_of(c.region(Region::kAll).errors).mae_px; });
  if (chart.curves.empty()) throw InvalidArgument("nothing to plot over frames: give a truth or a sequence");
  return make_plot(chart);
}

Plot plot_density(const DensityCounts& counts) {
  if (counts.kept.back() == 0) throw InvalidArgument("no density to plot: give a truth and a variance or confidence");
  Chart chart{"kept of the pixels with truth and estimate [%]",
              "bad of these [%]",
              0,
              100,
              {{"by uncertainty", {}}, {"oracle", {}}}};
  for (const SparsificationPoint& point : sparsification_of(counts)) {
    chart.curves[0].points.emplace_back(point.kept_percent, point.bad_percent);
    chart.curves[1].points.emplace_back(point.kept_percent, point.oracle_bad_percent);
  }
  return make_plot(chart);
}

}  // namespace

cv::Mat draw_over_frames(const std::vector<VideoCounts>& frames) { return draw_plot(plot_over_frames(frames)); }
std::string over_frames_svg(const std::vector<VideoCounts>& frames) { return plot_svg(plot_over_frames(frames)); }
cv::Mat draw_density(const DensityCounts& counts) { return draw_plot(plot_density(counts)); }
std::string density_svg(const DensityCounts& counts) { return plot_svg(plot_density(counts)); }

}  // namespace egosgm::vision
