// SPDX-License-Identifier: Apache-2.0
#include "vision/estimate_reader.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <optional>
#include <sstream>

#include "egosgm/error.h"
#include "egosgm/vision/disparity_io.h"
#include "host/quantile.h"
#include "vision/file_io.h"

namespace egosgm::vision {
namespace {

constexpr double kFarOff = 2.5;  // of a median ratio to the truth: no method errs so far
constexpr double kOtherScale = 1.15, kAlike = 0.04,
                 kMostAlike = 0.5;  // of ratios, and of pixels whose ratios are alike
constexpr double kKittiScale = 256;
constexpr double kLeastSigned = 65520;  // -16 in 16 bits

bool is_png(const std::filesystem::path& file) { return read_file_start(file, 4) == "\x89PNG"; }

/// Whether it is a .npy of whole numbers.
bool is_whole_npy(const std::filesystem::path& file) {
  const std::string start = read_file_start(file, 128);
  const std::size_t at = start.find("'descr'"), type = at == std::string::npos ? at : start.find('\'', at + 7);
  return start.starts_with("\x93NUMPY") && type != std::string::npos && type + 2 < start.size() &&
         (start[type + 2] == 'i' || start[type + 2] == 'u');
}

}  // namespace

Image read_scaled(const std::filesystem::path& file, double scale) {
  Image map = read_disparity(file, scale);
  if (scale == kKittiScale || !is_whole_npy(file)) return map;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      float& d = map.at<float>(y, x);
      if (is_valid_disparity(d)) d = static_cast<float>(d / scale);
    }
  }
  return map;
}

Image EstimateReader::read(const std::filesystem::path& file, double scale) {
  Image map = read_scaled(file, scale);
  const bool png = is_png(file);
  std::optional<float> marker;
  bool is_marker = true, zero_is_marker = true;
  std::int64_t values = 0, impossible = 0, markers = 0;
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const float d = map.at<float>(y, x);
      if (!is_valid_disparity(d) && !png) zero_is_marker = false;  // infinity is
      if (!is_valid_disparity(d) || d >= 0) continue;
      is_marker = is_marker && d == marker.value_or(d);
      marker = d;
    }
  }
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      float& d = map.at<float>(y, x);
      if (!is_valid_disparity(d)) continue;
      ++values;
      const bool beyond = d >= static_cast<float>(map.cols) || (png && d * scale >= kLeastSigned);
      impossible += beyond;
      markers += d < 0 && is_marker;
      if (beyond || (d == 0 && zero_is_marker) || (d < 0 && is_marker)) d = kInvalidDisparity;
    }
  }
  const std::scoped_lock lock(mutex_);
  values_ += values;
  impossible_ += impossible;
  markers_ += markers;
  if (markers > 0) marker_ = *marker;
  if (impossible > 0 && first_impossible_.empty()) first_impossible_ = file.string();
  return map;
}

void EstimateReader::compare(const Image& estimate, const Image& truth) {
  if (estimate.size() != truth.size()) return;
  std::vector<double> ratios;
  std::size_t surfaces = 0;
  for (int y = 0; y < estimate.rows; ++y) {
    for (int x = 0; x < estimate.cols; ++x) {
      const float e = estimate.at<float>(y, x), t = truth.at<float>(y, x);
      if (!is_valid_disparity(t) || !(t > 1)) continue;
      ++surfaces;
      if (is_valid_disparity(e) && e > 0) ratios.push_back(e / t);
    }
  }
  const double middle = ratios.empty() ? 1 : median(ratios);
  const auto are_alike = [&](double ratio) { return std::abs(ratio / middle - 1) <= kAlike; };
  const auto alike = static_cast<double>(std::count_if(ratios.begin(), ratios.end(), are_alike));
  const auto equal = static_cast<std::size_t>(std::count(ratios.begin(), ratios.end(), 1.0));
  const std::scoped_lock lock(mutex_);
  is_compared_ = true;
  has_truth_ = has_truth_ || surfaces > 0;
  differs_ = differs_ || equal != surfaces;
  if (ratios.empty()) return;
  ratios_.push_back(middle);
  alike_.push_back(alike / static_cast<double>(ratios.size()));
}

std::vector<std::string> EstimateReader::warnings(double scale, double truth_scale) const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> warnings;
  const auto add = [&](const auto&... parts) {
    std::ostringstream text;
    (text << ... << parts);
    warnings.push_back(text.str());
  };
  if (impossible_ > 0) {
    add(impossible_, " of ", values_,
        " values of estimates are no disparities, as they reach beyond the image's width or are negative ones written "
        "without a sign: they count as missing; the first are in ",
        first_impossible_);
  }
  if (markers_ > 0) add(markers_, " values of estimates are ", marker_, ", below 0: they count as missing");
  if (is_compared_ && !has_truth_) {
    add("the truth has no disparity above 1 px in any pixel: is it the right file, and its --truth-scale the right "
        "one?");
  } else if (is_compared_ && ratios_.empty()) {
    add("no estimate has a value above 0 where its truth has one: are they of the other sign, or of other frames?");
  }
  if (!ratios_.empty() && !differs_) {
    add("estimates equal their truth in every pixel: is a file compared with itself, or with a copy of it?");
  }
  const double ratio = ratios_.empty() ? 1 : median(ratios_);
  for (const double factor :
       {2.0, 4.0, 8.0, 16.0, 64.0, 256.0, 1.0 / 2, 1.0 / 4, 1.0 / 8, 1.0 / 16, 1.0 / 64, 1.0 / 256}) {
    if (std::abs(ratio / factor - 1) > 0.08) continue;
    add(std::setprecision(4), "estimates are ", ratio, std::setprecision(6),
        " times their truth in the median: is it another scale? A PNG of ", scale * factor,
        " steps a pixel needs --scale ", scale * factor,
        "; maps of images of another width, and other formats, need their values changed");
    return warnings;
  }
  const auto is_off = [&](double most) { return ratio > most || ratio < 1 / most; };
  if (is_off(kFarOff)) {
    add(std::setprecision(4), "estimates are ", ratio,
        " times their truth in the median: are they disparities in pixels? Depths, inverse depths and shares of the "
        "width are none");
  } else if (is_off(kOtherScale) && median(alike_) >= kMostAlike) {
    add(std::setprecision(4), "estimates are ", ratio,
        " times their truth in the median, and most of them alike: is one of both of another scale? A truth in PNG of ",
        truth_scale / ratio, " steps a pixel needs --truth-scale ", truth_scale / ratio, ", an estimate of ",
        scale * ratio, " --scale ", scale * ratio,
        "; maps of images of another width, and other formats, need their values changed");
  }
  return warnings;
}

void expect_scaled(const std::string& option, double scale, const std::filesystem::path& file) {
  if (scale == kKittiScale || file.empty() || is_png(file) || is_whole_npy(file)) return;
  std::ostringstream text;
  text << option << ' ' << scale << ": is for 16-bit PNG and .npy of whole numbers, and " << file.string()
       << " is neither: divide its values, or leave the option out";
  throw InvalidArgument(text.str());
}

}  // namespace egosgm::vision
