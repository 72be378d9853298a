// SPDX-License-Identifier: Apache-2.0
#include "host/vision/plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

namespace egosgm::vision {
namespace {

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
  const int baseline = size.height + below;  // brackets rise above what OpenCV calls the height
  cv::Mat text(baseline + below + 2, size.width + 2, CV_8UC3, cv::Scalar::all(255));
  cv::putText(text, label.text, {1, baseline}, cv::FONT_HERSHEY_SIMPLEX, kScale, cv::Scalar(kInk[2], kInk[1], kInk[0]),
              1, cv::LINE_AA);
  const double before = label.anchor == Anchor::kStart    ? 0
                        : label.anchor == Anchor::kMiddle ? size.width / 2.0
                                                          : size.width;
  cv::Point corner(cvRound(label.at.x - before), cvRound(label.at.y) - baseline);
  if (label.upwards) {
    cv::rotate(text, text, cv::ROTATE_90_COUNTERCLOCKWISE);
    corner = {cvRound(label.at.x) - baseline, cvRound(label.at.y - before)};
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

double tick_step(double length, int ticks) {
  const double raw = length / ticks, power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (raw <= step * power) return step * power;
  }
  return 10 * power;
}

std::string format(const char* pattern, double a, double b) {
  char text[96];
  std::snprintf(text, sizeof text, pattern, a, b);
  return text;
}

cv::Mat draw_plot(const Plot& plot) {
  cv::Mat picture(cvRound(plot.size.height), cvRound(plot.size.width), CV_8UC3, cv::Scalar::all(255));
  for (const Line& line : plot.lines) draw(line, picture);
  for (const Label& label : plot.labels) draw(label, picture);
  return picture;
}

std::string plot_svg(const Plot& plot) {
  std::string text = format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" ",
                            plot.size.width, plot.size.height) +
                     "font-family=\"sans-serif\" font-size=\"13\" fill=\"" + svg_color(kInk) + "\">\n" +
                     "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  for (const Line& line : plot.lines) text += svg(line);
  for (const Label& label : plot.labels) text += svg(label);
  return text + "</svg>\n";
}

}  // namespace egosgm::vision
