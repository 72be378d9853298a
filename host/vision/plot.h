// SPDX-License-Identifier: Apache-2.0
// Lines and labels that can be drawn as a picture and written as SVG.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace egosgm::vision {

using Rgb = std::array<int, 3>;

inline constexpr Rgb kInk{40, 40, 40}, kGrid{222, 222, 222};

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

/// In pixels.
struct Plot {
  cv::Size2d size;
  std::vector<Line> lines;
  std::vector<Label> labels;
};

/// 1, 2 or 5 times a power of ten: the distance of about so many ticks.
double tick_step(double length, int ticks);

/// printf of up to two numbers.
std::string format(const char* pattern, double a, double b = 0);

cv::Mat draw_plot(const Plot& plot);  // BGR
std::string plot_svg(const Plot& plot);

}  // namespace egosgm::vision
