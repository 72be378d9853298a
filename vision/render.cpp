// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/render.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

#include "egosgm/error.h"
#include "egosgm/reason.h"
#include "egosgm/vision/disparity_io.h"
#include "host/quantile.h"
#include "vision/drawing.h"
#include "vision/image_values.h"

namespace egosgm::vision {
namespace {

constexpr int kBarHeight = 40, kBarColors = 22;  // [px]; below the colours stands the text
constexpr int kSmallWidth = 640;                 // of a bar; below, its letters are small [px]
constexpr Color kBlack{0, 0, 0}, kMissing{128, 128, 128};

/// |error| below limit_px has this colour: ColorBrewer's RdYlBu in ten classes, BGR.
struct ErrorStep {
  float limit_px;
  const char* label;
  Color color;
};
const std::array<ErrorStep, 10> kErrorSteps = {{{0.1875f, "0.19", {149, 54, 49}},
                                                {0.375f, "0.38", {180, 117, 69}},
                                                {0.75f, "0.75", {209, 173, 116}},
                                                {1.5f, "1.5", {233, 217, 171}},
                                                {3.0f, "3 px", {248, 243, 224}},
                                                {6.0f, "6", {144, 224, 254}},
                                                {12.0f, "12", {97, 174, 253}},
                                                {24.0f, "24", {67, 109, 244}},
                                                {48.0f, "48", {39, 48, 215}},
                                                {INFINITY, "", {38, 0, 165}}}};

/// By Reason, BGR.
const std::array<Color, kReasonCount> kReasonColors = {{{0, 0, 0},         // trusted
                                                        {160, 90, 40},     // unconfirmed
                                                        {230, 200, 60},    // uncovered
                                                        {60, 60, 240},     // contradicted
                                                        {250, 130, 200},   // nearer
                                                        {0, 140, 255},     // ambiguous
                                                        {110, 110, 110},   // flat
                                                        {255, 255, 255},   // saturated
                                                        {90, 160, 60},     // speckle
                                                        {80, 230, 250}}};  // predicted

void require_map(const Image& map, const char* name) {
  if (map.empty() || map.type != kF32) {
    throw InvalidArgument(std::string(name) + ": the map must be float32 and not empty");
  }
}

void require_same_size(const Image& a, const Image& b, const char* name) {
  if (a.size() != b.size()) throw InvalidArgument(std::string(name) + ": both maps must have the same size");
}

void require_range(const ColorRange& range) {
  if (!(range.low < range.high) || !std::isfinite(range.low) || !std::isfinite(range.high) ||
      (range.logarithmic && !(range.low > 0))) {
    throw InvalidArgument(
        "color range: low must be less than high, both finite, and low positive on a logarithmic scale");
  }
}

/// Maps values to their place in a range, 0..1.
class Scale {
 public:
  explicit Scale(const ColorRange& range)
      : range_(range), span_(range.logarithmic ? std::log(range.high / range.low) : range.high - range.low) {}
  double position_of(double value) const {
    const double from_low =
        range_.logarithmic ? std::log(std::max(value, range_.low) / range_.low) : value - range_.low;
    return std::clamp(from_low / span_, 0.0, 1.0);
  }

 private:
  const ColorRange range_;
  const double span_;
};

double value_at(const ColorRange& range, double position) {
  return range.logarithmic ? range.low * std::pow(range.high / range.low, position)
                           : range.low + position * (range.high - range.low);
}

Color error_color(float error_px) {
  for (const ErrorStep& step : kErrorSteps) {
    if (error_px < step.limit_px) return step.color;
  }
  return kErrorSteps.back().color;
}

/// Text centred at x, moved so far that it stays in the picture.
void put_label(Image& picture, const std::string& text, double center_x) {
  const int scale = picture.cols < kSmallWidth ? 1 : 2, width = text_width(text, scale);
  const int left = std::clamp(static_cast<int>(center_x) - width / 2, 1, std::max(1, picture.cols - width - 1));
  draw_text(picture, text, left, kBarHeight - 2, scale);
}

std::string format_value(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.3g", value);
  return buffer;
}

}  // namespace

ColorRange disparity_range(const Image& disparity) {
  require_map(disparity, "disparity_range");
  constexpr double kQuantile = 0.995;
  std::vector<float> values;
  for (int y = 0; y < disparity.rows; ++y) {
    const auto* row = disparity.row<float>(y);
    std::copy_if(row, row + disparity.cols, std::back_inserter(values), is_valid_disparity);
  }
  if (values.empty()) return {.low = 0, .high = 1};
  const double low = std::min(0.0, static_cast<double>(*std::min_element(values.begin(), values.end())));
  const auto at = static_cast<std::size_t>(kQuantile * static_cast<double>(values.size() - 1));
  const double high = nth_value(std::move(values), at);
  return {.low = low, .high = std::max(high, low + 1.0)};
}

Image color_map(const Image& map, ColorRange range) {
  require_map(map, "color_map");
  require_range(range);
  const Scale scale(range);
  Image picture(map.size(), kBgr8, 0);
  float last = kInvalidDisparity;  // widths of the search are often those of the pixel before
  Color color;
  for (int y = 0; y < map.rows; ++y) {
    const auto* row = map.row<float>(y);
    auto* colored = picture.row<Color>(y);
    for (int x = 0; x < map.cols; ++x) {
      if (!is_valid_disparity(row[x])) continue;
      if (row[x] != last) color = turbo(scale.position_of(row[x]));
      last = row[x];
      colored[x] = color;
    }
  }
  return picture;
}

Image color_disparity(const Image& disparity) { return color_map(disparity, disparity_range(disparity)); }

Image color_disparity(const Image& disparity, ColorRange range) { return color_map(disparity, range); }

Image color_variance(const Image& variance, const Image& disparity, ColorRange range) {
  require_map(variance, "color_variance");
  require_map(disparity, "color_variance");
  require_same_size(variance, disparity, "color_variance");
  Image picture = color_map(variance, range);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      if (!is_valid_disparity(disparity.at<float>(y, x))) picture.at<Color>(y, x) = kBlack;
    }
  }
  return picture;
}

Image color_error(const Image& estimate, const Image& truth) {
  require_map(estimate, "color_error");
  require_map(truth, "color_error");
  require_same_size(estimate, truth, "color_error");
  Image picture(truth.size(), kBgr8, 0);
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const float t = truth.at<float>(y, x);
      if (!is_valid_disparity(t)) continue;
      const float e = estimate.at<float>(y, x);
      const Color color = is_valid_disparity(e) ? error_color(std::abs(t - e)) : kMissing;
      for (int v = std::max(y - 1, 0); v <= std::min(y + 1, truth.rows - 1); ++v) {
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, truth.cols - 1); ++u) {
          const bool own = u == x && v == y;
          if (own || !is_valid_disparity(truth.at<float>(v, u))) picture.at<Color>(v, u) = color;
        }
      }
    }
  }
  return picture;
}

Image color_bar(int width, ColorRange range, const std::string& unit) {
  require_width(width);
  require_range(range);
  constexpr int kIntervals = 4;
  Image bar(kBarHeight, width, kBgr8, 0);
  for (int x = 0; x < width; ++x) {
    const Color color = turbo(static_cast<double>(x) / std::max(1, width - 1));
    bar.part(x, 0, 1, kBarColors).fill(color);
  }
  for (int i = 0; i <= kIntervals; ++i) {
    const double position = static_cast<double>(i) / kIntervals;
    put_label(bar, format_value(value_at(range, position)) + (i == kIntervals ? " " + unit : ""), position * width);
  }
  return bar;
}

Image error_bar(int width) {
  require_width(width);
  constexpr int kFields = static_cast<int>(kErrorSteps.size()) + 1;
  Image bar(kBarHeight, width, kBgr8, 0);
  for (int x = 0; x < width; ++x) {
    const auto field = static_cast<std::size_t>(static_cast<std::int64_t>(x) * kFields / width);
    const Color color = field < kErrorSteps.size() ? kErrorSteps[field].color : kMissing;
    bar.part(x, 0, 1, kBarColors).fill(color);
  }
  for (std::size_t i = 0; i + 1 < kErrorSteps.size(); ++i) {
    put_label(bar, kErrorSteps[i].label, static_cast<double>(i + 1) * width / kFields);
  }
  put_label(bar, "none", (kFields - 0.5) * width / kFields);
  return bar;
}

Image color_reasons(const Image& reasons) {
  if (reasons.empty() || reasons.type != kU8) {
    throw InvalidArgument("color_reasons: the map must be uint8 and not empty");
  }
  Image picture(reasons.size(), kBgr8);
  for (int y = 0; y < reasons.rows; ++y) {
    for (int x = 0; x < reasons.cols; ++x) {
      const std::uint8_t reason = reasons.at<std::uint8_t>(y, x);
      if (reason >= kReasonCount) {
        throw InvalidArgument("color_reasons: " + std::to_string(reason) + " is no reason: they are 0 to " +
                              std::to_string(kReasonCount - 1));
      }
      picture.at<Color>(y, x) = kReasonColors[reason];
    }
  }
  return picture;
}

Image reason_bar(int width) {
  require_width(width);
  constexpr int kFields = kReasonCount / 2;
  Image rows[2];
  for (int row = 0; row < 2; ++row) {
    rows[row] = Image(kBarHeight, width, kBgr8, 0);
    for (int field = 0; field < kFields; ++field) {
      const int reason = row * kFields + field, left = field * width / kFields, end = (field + 1) * width / kFields;
      rows[row].part(left, 0, end - left, kBarColors).fill(kReasonColors[reason]);
      put_label(rows[row], to_string(static_cast<Reason>(reason)), (field + 0.5) * width / kFields);
    }
  }
  return stacked(rows[0], rows[1]);
}

Image depth_from_disparity(const Image& disparity, const Calibration& calibration) {
  require_map(disparity, "depth_from_disparity");
  calibration.validate();
  const double numerator = calibration.fx * calibration.baseline_m;
  Image depth_m(disparity.size(), kF32, kInvalidDisparity);
  for (int y = 0; y < disparity.rows; ++y) {
    const auto* row = disparity.row<float>(y);
    auto* depths = depth_m.row<float>(y);
    for (int x = 0; x < disparity.cols; ++x) {
      const double d = row[x] + calibration.doffs_px;
      if (is_valid_disparity(row[x]) && d > 0) depths[x] = static_cast<float>(numerator / d);
    }
  }
  return depth_m;
}

}  // namespace egosgm::vision
