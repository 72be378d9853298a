// SPDX-License-Identifier: Apache-2.0
#include "host/vision/examination.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "egosgm/vision/image_io.h"
#include "host/vision/doubt.h"
#include "host/vision/grey_bytes.h"

namespace egosgm::vision {
namespace {

constexpr std::size_t kFewestMatches = 30;
constexpr double kMaxOffset_px = 0.6;    // KITTI's own pairs reach that
constexpr double kMaxSpread_px = 1.0;    // of the rest, 90 % of the matches that agree
constexpr double kAgreement_px = 1.0;    // of a match with what most of them say
constexpr double kFewestAgreeing = 0.4;  // of the matches; below, they are mistaken for each other
constexpr double kClippedShare = 0.01;   // of the points
constexpr double kBehindShare = 0.02;    // with a disparity that no point before the cameras has
constexpr double kBehind_px = 1.0;       // by more than this
constexpr double kMaxBrightness = 1.25;  // of one image by the other's
constexpr int kCoarseWidth = 256;        // images are made smaller, down to this
constexpr double kFewestCoarse = 0.03;   // of the pixels; below, the coarse map says nothing

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  char text[300];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

std::string counted(std::size_t count, const char* what) {
  return formatted("%zu %s%s", count, what, count == 1 ? "" : "s");
}

template <typename T>
T quantile(std::vector<T> values, double at) {
  const auto place = std::lround(at * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

double share(const std::vector<float>& values, const std::function<bool(double)>& which) {
  return static_cast<double>(std::count_if(values.begin(), values.end(), which)) / static_cast<double>(values.size());
}

/// The mean difference [grey levels] of the block around (x, y) and the one `d` to the left in the other image.
double block_difference(const cv::Mat& left, const cv::Mat& right, int x, int y, int d) {
  constexpr int kRadius = 3;
  int sum = 0, count = 0;
  for (int v = std::max(0, y - kRadius); v <= std::min(left.rows - 1, y + kRadius); ++v) {
    for (int u = std::max({0, x - kRadius, d}); u <= std::min({left.cols - 1, x + kRadius, right.cols - 1 + d}); ++u) {
      // To what lies between the neighbours, as a disparity falls between pixels (Birchfield and Tomasi).
      const auto* row = right.ptr(v);
      const int here = row[u - d], before = (here + row[std::max(u - d - 1, 0)]) / 2,
                after = (here + row[std::min(u - d + 1, right.cols - 1)]) / 2;
      const int value = left.at<std::uint8_t>(v, u);
      sum += std::max({0, value - std::max({here, before, after}), std::min({here, before, after}) - value});
      ++count;
    }
  }
  return count == 0 ? 255.0 : static_cast<double>(sum) / count;
}

/// Whether a disparity in [least, end) explains the images nearly as well as `d`.
bool is_ambiguous(const cv::Mat& left, const cv::Mat& right, int x, int y, int d, int least, int end) {
  constexpr double kNoise = 3;  // grey levels
  const double enough = 1.5 * block_difference(left, right, x, y, d) + kNoise;
  for (int other = std::max(least, x - right.cols + 1); other < std::min(end, x + 1); ++other) {
    if (block_difference(left, right, x, y, other) <= enough) return true;
  }
  return false;
}

/// Disparities [px] of a small pair, sought from minus to plus half the width: where nothing is sure, there is none.
/// One outside of [least, end) counts only where none in it explains the images nearly as well, as where texture
/// repeats.
std::vector<float> coarse_disparities(const cv::Mat& left, const cv::Mat& right, double row_offset_px, int least,
                                      int end) {
  const int factor = std::max(1, (left.cols + kCoarseWidth - 1) / kCoarseWidth);
  const cv::Size size(left.cols / factor, left.rows / factor);
  if (size.width < 32 || size.height < 16) return {};
  const int half = (size.width / 2 + 15) / 16 * 16;
  cv::Mat small[2], wide[2], found;
  const cv::Mat back = (cv::Mat_<double>(2, 3) << 1, 0, 0, 0, 1, -row_offset_px);
  cv::Mat aligned;
  cv::warpAffine(right, aligned, back, right.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  for (int i = 0; i < 2; ++i) {
    cv::resize(i == 0 ? left : aligned, small[i], size, 0, 0, cv::INTER_AREA);
    cv::copyMakeBorder(small[i], wide[i], 0, 0, half, half, cv::BORDER_CONSTANT, cv::Scalar(0));
  }
  constexpr int kBlock = 5;
  const auto matcher = cv::StereoSGBM::create(-half, 2 * half, kBlock, 8 * kBlock * kBlock, 32 * kBlock * kBlock,
                                              /*disp12MaxDiff=*/1, /*preFilterCap=*/31, /*uniquenessRatio=*/15,
                                              /*speckleWindowSize=*/40, /*speckleRange=*/1);
  matcher->compute(wide[0], wide[1], found);
  cv::Mat edges;
  cv::Sobel(small[0], edges, CV_16S, 1, 0);
  std::vector<float> disparities;
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const float d = static_cast<float>(found.at<std::int16_t>(y, x + half)) / 16;
      const bool is_sure = d > static_cast<float>(-half) - 0.5f && std::abs(edges.at<std::int16_t>(y, x)) >= 24;
      if (!is_sure || x - d < 0 || x - d >= static_cast<float>(size.width)) continue;
      const float full = d * static_cast<float>(factor);
      const bool is_outside = full < static_cast<float>(least) - 1 || full > static_cast<float>(end);
      if (is_outside &&
          is_ambiguous(small[0], small[1], x, y, static_cast<int>(std::lround(d)), least / factor, end / factor)) {
        continue;
      }
      disparities.push_back(full);
    }
  }
  if (static_cast<double>(disparities.size()) < kFewestCoarse * size.area()) return {};
  return disparities;
}

int rounded_up(double value) { return 16 * static_cast<int>(std::ceil(value / 16)); }

std::optional<Clipped> clipped_of(const std::vector<float>& disparities, int least, int end) {
  const double above = share(disparities, [&](double d) { return d > end - 1; });
  if (above <= kClippedShare) return std::nullopt;
  return Clipped{above, rounded_up(1.1 * quantile(disparities, 0.995) - least + 1)};
}

/// What rows of both images differ by, as a smooth function of the place and of the disparity, which a pair that is not
/// rectified has; by the matches on which most agree.
struct RowError {
  static constexpr int kTerms = 7;
  using Terms = cv::Vec<double, kTerms>;

  static Terms terms(const PairMatch& match, cv::Size size) {
    const double x = match.left.x / size.width - 0.5, y = match.left.y / size.height - 0.5;
    return {1, x, y, x * y, x * x, y * y, (match.left.x - match.right.x) / size.width};
  }
};

/// Places, in `matches`, of those that agree.
std::vector<std::size_t> agreeing(const std::vector<PairMatch>& matches, cv::Size size) {
  constexpr int kTries = 1000;
  constexpr std::size_t kMostLookedAt = 1500;
  std::vector<RowError::Terms> terms;
  std::vector<double> errors;
  for (const PairMatch& match : matches) {
    terms.push_back(RowError::terms(match, size));
    errors.push_back(match.right.y - match.left.y);
  }
  const std::size_t step = 1 + matches.size() / kMostLookedAt;
  cv::RNG random(1);
  RowError::Terms best{};
  std::size_t most = 0;
  for (int i = 0; i < kTries; ++i) {
    cv::Matx<double, RowError::kTerms, RowError::kTerms> a;
    RowError::Terms b, candidate;
    for (int k = 0; k < RowError::kTerms; ++k) {
      const auto at = static_cast<std::size_t>(random.uniform(0, static_cast<int>(matches.size())));
      for (int column = 0; column < RowError::kTerms; ++column) a(k, column) = terms[at][column];
      b[k] = errors[at];
    }
    if (!cv::solve(a, b, candidate, cv::DECOMP_LU)) continue;
    std::size_t count = 0;
    for (std::size_t m = 0; m < matches.size(); m += step) {
      count += std::abs(terms[m].dot(candidate) - errors[m]) <= kAgreement_px;
    }
    if (count > most) most = count, best = candidate;
  }
  std::vector<std::size_t> kept;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (std::abs(terms[m].dot(best) - errors[m]) <= kAgreement_px) kept.push_back(m);
  }
  return kept;
}

double median_row_error(const std::vector<PairMatch>& matches) {
  std::vector<double> errors;
  for (const PairMatch& match : matches) errors.push_back(match.right.y - match.left.y);
  return errors.empty() ? 0 : quantile(errors, 0.5);
}

/// How the misalignment changes from left to right and from top to bottom, by least squares.
std::string slope_text(const std::vector<cv::Vec3d>& places, const std::vector<double>& errors) {
  cv::Mat fit;
  const cv::Mat a(static_cast<int>(places.size()), 3, CV_64F, const_cast<cv::Vec3d*>(places.data()));
  if (!cv::solve(a, cv::Mat(errors), fit, cv::DECOMP_SVD)) return {};
  return formatted(", %+.2f px from left to right, %+.2f px from top to bottom", fit.at<double>(1), fit.at<double>(2));
}

}  // namespace

void Examination::add(const cv::Mat& left, const cv::Mat& right) {
  const std::vector<PairMatch> found = match_pair(left, right);
  size_ = left.size();
  depth_bits_ = left.depth() == CV_8U ? 8 : 16;
  left_brightness_ += cv::mean(left)[0];
  right_brightness_ += cv::mean(right)[0];
  ++frames_;
  narrow_ += holds_8_bits_in_16(left) && holds_8_bits_in_16(right);
  matches_.insert(matches_.end(), found.begin(), found.end());
  const auto [left_bytes, right_bytes] = bytes_of(left, right);
  const std::vector<float> coarse = coarse_disparities(left_bytes, right_bytes, median_row_error(found), least_, end_);
  disparities_.insert(disparities_.end(), coarse.begin(), coarse.end());
}

std::optional<Clipped> clipped_by_range(const cv::Mat& left, const cv::Mat& right, int least, int end) {
  const auto [left_bytes, right_bytes] = bytes_of(left, right);
  const std::vector<float> disparities = coarse_disparities(left_bytes, right_bytes, 0, least, end);
  return disparities.empty() ? std::nullopt : clipped_of(disparities, least, end);
}

std::vector<Finding> Examination::findings(std::size_t pairs) const {
  std::vector<Finding> found{images(pairs), calibration()};
  if (matches_.size() < kFewestMatches) {
    found.push_back({Verdict::kProblem, "matches",
                     "only " + counted(matches_.size(), "point") + " found in both images",
                     "give the left and right images of the same moments, sharp, and overlapping"});
    return found;
  }
  found.push_back(rows());
  std::vector<float> disparities = disparities_;
  if (disparities.empty()) {
    for (const PairMatch& match : matches_) disparities.push_back(match.left.x - match.right.x);
  }
  // A point before the cameras has d + doffs > 0.
  const double doffs = calibration_ ? calibration_->doffs_px : 0;
  const double behind = share(disparities, [&](double d) { return d + doffs < -kBehind_px; });
  found.push_back(sides(behind));
  if (behind <= 0.5) found.push_back(range(std::move(disparities)));
  return found;
}

Finding Examination::images(std::size_t pairs) const {
  const std::string text =
      counted(pairs, "pair") + formatted(" of %dx%d, %zu bit", size_.width, size_.height, depth_bits_);
  if (narrow_ == frames_) {
    return {Verdict::kProblem, "images",
            text + ", but no value above 255: the upper 8 bits, which tell edges, are empty",
            "save them with 8 bits, or multiply the values by 257"};
  }
  const double ratio = (left_brightness_ + 1) / (right_brightness_ + 1);
  if (std::max(ratio, 1 / ratio) <= kMaxBrightness) return {Verdict::kFine, "images", text, {}};
  return {Verdict::kNote, "images",
          text + formatted("; the left ones are %.2f times as bright as the right ones", ratio),
          "expose both cameras alike; the census cost bears it, sad3x3 does not"};
}

Finding Examination::calibration() const {
  if (!calibration_) {
    return {Verdict::kNote, "calibration", "none was given: there is no depth and no odometry", "give --calib FILE"};
  }
  const Calibration& c = *calibration_;
  const std::string text =
      formatted("fx %.1f, fy %.1f, cx %.1f, cy %.1f px, baseline %.4g m", c.fx, c.fy, c.cx, c.cy, c.baseline_m);
  const auto suspicion = suspect_calibration(c, size_);
  if (!suspicion) return {Verdict::kFine, "calibration", text, {}};
  return {Verdict::kProblem, "calibration", text + ": " + suspicion->what, suspicion->remedy};
}

/// The rows of the two views: a constant offset, and what is left beside it.
Finding Examination::rows() const {
  const std::vector<std::size_t> kept = agreeing(matches_, size_);
  const std::string of = counted(matches_.size(), "point") + " in " + counted(frames_, "frame");
  if (static_cast<double>(kept.size()) < kFewestAgreeing * static_cast<double>(matches_.size())) {
    return {Verdict::kNote, "rows", formatted("only %zu of ", kept.size()) + of + " agree on how far rows are apart",
            "textures that repeat are mistaken for each other: look at frames of other things"};
  }
  std::vector<double> errors, rest;
  std::vector<cv::Vec3d> places;
  for (const std::size_t at : kept) {
    const PairMatch& match = matches_[at];
    errors.push_back(match.right.y - match.left.y);
    places.emplace_back(1, match.left.x / size_.width, match.left.y / size_.height);
  }
  const double offset = quantile(errors, 0.5);
  for (const double error : errors) rest.push_back(std::abs(error - offset));
  const double spread = quantile(rest, 0.9);
  const std::string text =
      formatted("vertical misalignment %.2f px in the median, 90 %% within %.2f px of it (", offset, spread) + of +
      ")" + slope_text(places, errors);
  if (std::abs(offset) <= kMaxOffset_px && spread <= kMaxSpread_px) return {Verdict::kFine, "rows", text, {}};
  return {Verdict::kProblem, "rows", text,
          formatted("%.1f px: rectify again (egosgm rectify, from the raw images and a new calibration)",
                    std::max(std::abs(offset), spread))};
}

Finding Examination::sides(double behind) const {
  const std::string text = formatted("%.1f %% of the points lie behind the cameras", 100 * behind);
  if (behind > 0.5) {
    return {Verdict::kProblem, "sides", text,
            "left and right are swapped: exchange the images (and their calibrations)"};
  }
  if (behind <= kBehindShare) return {Verdict::kFine, "sides", text, {}};
  return {Verdict::kProblem, "sides", text,
          "the principal points differ by more than doffs_px says, or the cameras converge: rectify again, or give "
          "--min-disparity and doffs_px"};
}

Finding Examination::range(std::vector<float> disparities) const {
  const double low = quantile(disparities, 0.005), high = quantile(disparities, 0.995);
  const double below = share(disparities, [&](double d) { return d < least_ - kBehind_px; });
  const std::string text = formatted("disparities from %.1f to %.1f px (99 %% of the points), the range is [%d, %d)",
                                     low, high, least_, end_);
  const double farthest = quantile(disparities, 0.999);
  if (const auto clipped = clipped_of(disparities, least_, end_)) {
    return {Verdict::kProblem, "range",
            text + formatted(": it clips %.1f %% of them, the near ones", 100 * clipped->share),
            formatted("give --disparities %d", clipped->disparities)};
  }
  if (below > kClippedShare && high > 0) {
    return {Verdict::kProblem, "range", text + formatted(": it clips %.1f %% of them, the far ones", 100 * below),
            formatted("give --min-disparity %d", static_cast<int>(std::floor(low)) - 2)};
  }
  if (2 * (farthest - least_ + 1) < end_ - least_) {
    return {Verdict::kNote, "range", text + ": half of it is never needed",
            formatted("--disparities %d is faster", std::max(16, rounded_up(1.25 * farthest - least_ + 1)))};
  }
  return {Verdict::kFine, "range", text, {}};
}

}  // namespace egosgm::vision
