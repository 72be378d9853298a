// SPDX-License-Identifier: Apache-2.0
#include "vision/input_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iterator>
#include <string_view>
#include <utility>

#include "egosgm/vision/image_io.h"
#include "kernels/method.h"
#include "vision/grey_bytes.h"
#include "vision/mosaic.h"

namespace egosgm::vision {
namespace {

constexpr double kMinBaseline_m = 0.004, kMaxBaseline_m = 3.0;
constexpr double kUsualBaseline_m[] = {0.02, 1.0};
constexpr double kMinFocal = 0.15, kMaxFocal = 30;  // of the width
// Of the sides, from the middle: 35 real sequences lie within 0.1. One that is scaled by itself moves both coordinates.
constexpr double kMaxOffMiddle = 0.2, kMaxOffBoth = 0.1;
constexpr double kMaxStretch = 1.15;  // of one focal length by the other, where the principal point is off, too
constexpr int kFewPixels = 16;        // a principal point that is nearer to the first pixel is in another unit
constexpr double kMinDensity = 0.5;
constexpr double kFarRows_px = 0.9 * EGOSGM_MAX_OFFSET_PX;
constexpr std::size_t kFramesPerLook = 50;  // for what is nearer than the range

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  char text[200];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

void append(std::string& text, const std::string& part) { text += (text.empty() ? "" : ", ") + part; }

/// The digest of all bytes; images that differ have different ones, as good as surely.
std::uint64_t digest_of(const Image& image) {
  std::uint64_t digest = 0;
  for (int y = 0; y < image.rows; ++y) {
    const std::string_view row(image.row<char>(y), image.cols * image.type.pixel_bytes());
    digest = 31 * digest + std::hash<std::string_view>()(row);
  }
  return digest;
}

/// Whether all pixels have one value.
bool is_plain(const Image& image) {
  const std::size_t pixel = image.type.pixel_bytes();
  const std::string_view first(image.row<char>(0), image.cols * pixel);
  if (first.substr(pixel) != first.substr(0, first.size() - pixel)) return false;
  for (int y = 1; y < image.rows; ++y) {
    if (std::string_view(image.row<char>(y), first.size()) != first) return false;
  }
  return true;
}

/// `share`: of a side.
bool is_within(double share, double most) { return std::abs(share - 0.5) < most; }

bool is_usual(double baseline_m) { return baseline_m >= kUsualBaseline_m[0] && baseline_m <= kUsualBaseline_m[1]; }

/// Units in which a baseline that is too long for metres would be a usual one.
std::string units_of(double baseline) {
  std::string units;
  for (const auto& [unit, unit_m] :
       {std::pair{"centimetres", 0.01}, {"millimetres", 0.001}, {"decimetres", 0.1}, {"inches", 0.0254}}) {
    if (!is_usual(baseline * unit_m)) continue;
    units += formatted("%s%s (%.4g m)", units.empty() ? "" : " or ", unit, baseline * unit_m);
  }
  return units.empty() ? "a chessboard's squares or other units" : units;
}

}  // namespace

std::optional<Suspicion> suspect_baseline(double baseline_m, double fx) {
  const std::string what = formatted("a baseline of %.4g m", baseline_m);
  if (baseline_m > kUsualBaseline_m[1]) {
    const bool is_certain = baseline_m > kMaxBaseline_m;
    return Suspicion{what,
                     (is_certain ? "a baseline is in metres: is this one in "
                                 : "few rigs are wider than a metre, and depths grow with the baseline: is it in ") +
                         units_of(baseline_m) + "?",
                     is_certain};
  }
  if (baseline_m < kMinBaseline_m) {
    const std::string missing = is_usual(baseline_m * fx)
                                    ? formatted(
                                          " A camera info's Tx is -fx times the baseline: is fx missing, so that "
                                          "it is %.4g m?",
                                          baseline_m * fx)
                                    : "";
    const std::string counted =
        is_usual(1000 * baseline_m)
            ? formatted(" Middlebury's is in millimetres: is this one in metres there, %.4g m?", 1000 * baseline_m)
            : "";
    return Suspicion{what, "no two cameras stand so close: give the distance of these in metres." + missing + counted};
  }
  return std::nullopt;
}

std::optional<Suspicion> suspect_calibration(const Calibration& c, Size size) {
  if (auto baseline = suspect_baseline(c.baseline_m, c.fx)) return baseline;
  if (size.empty()) return std::nullopt;
  const std::string remedy =
      "give the calibration of images of this size: scale fx, fy, cx, cy as the images were scaled, and subtract what "
      "was cropped from cx, cy";
  const std::string of_size = formatted("%dx%d", size.width, size.height);
  if (std::max(c.cx, c.cy) < kFewPixels && std::min(c.cx, c.cy) > 0 &&
      std::min(size.width, size.height) > 4 * kFewPixels) {
    return Suspicion{formatted("fx %.4g, cx %.4g and cy %.4g are no pixels of images of ", c.fx, c.cx, c.cy) + of_size,
                     std::max(c.cx, c.cy) <= 1
                         ? "are they shares of the sides? Multiply fx and cx by the width, fy and cy by the height"
                         : "are they millimetres? Divide them by the side of a pixel in millimetres"};
  }
  const double x = (c.cx + 0.5) / size.width, y = (c.cy + 0.5) / size.height;  // the first pixel's middle is 0
  const bool is_off = !is_within(x, kMaxOffBoth) && !is_within(y, kMaxOffBoth);
  if (is_off && is_within((c.cx + 0.5) / size.height, kMaxOffBoth / 2) &&
      is_within((c.cy + 0.5) / size.width, kMaxOffBoth / 2)) {
    return Suspicion{
        formatted("the principal point (cx %.1f, cy %.1f) is that of images of %dx%d: these of ", c.cx, c.cy,
                  size.height, size.width) +
            of_size + " are turned by 90 degrees, or cx and cy are exchanged",
        "turn them back, as only so do the cameras stand side by side; exchange cx and cy where they stand upright"};
  }
  const bool is_far = !is_within(x, kMaxOffMiddle) || !is_within(y, kMaxOffMiddle);
  const double least = std::min(c.fx, c.fy), largest = std::max(c.fx, c.fy);
  const bool is_stretched = largest > kMaxStretch * least && (!is_within(x, kMaxOffBoth) || !is_within(y, kMaxOffBoth));
  const bool is_scaled = (is_off && (x > 0.5) == (y > 0.5)) || is_stretched;
  if (is_far || is_scaled) {
    return Suspicion{
        "the principal point is far from the middle of " + of_size + formatted(" (cx %.1f, cy %.1f)", c.cx, c.cy),
        remedy, is_far};
  }
  if (!is_within((c.cx + 0.5 + c.doffs_px) / size.width, kMaxOffMiddle)) {
    return Suspicion{formatted("with doffs_px %.4g the right principal point is at x %.1f in images of ", c.doffs_px,
                               c.cx + c.doffs_px) +
                         of_size,
                     "give the right image's cx less the left one's as doffs_px"};
  }
  if (least < kMinFocal * size.width || largest > kMaxFocal * size.width || largest > 2 * least) {
    return Suspicion{formatted("focal lengths of %.4g and %.4g px in images of ", c.fx, c.fy) + of_size, remedy};
  }
  return std::nullopt;
}

void InputCheck::add(const Image& left, const Image& right, const FrameReport& report, bool has_motion) {
  if (frames_ % kFramesPerLook == 0) {
    const std::optional<Clipped> clipped = clipped_by_range(left, right, least_, end_);
    if (clipped && clipped->near_share > nearer_.near_share) nearer_ = *clipped;
    if (clipped && clipped->far_share > farther_.far_share) farther_ = *clipped;
    ++looks_;
    const auto [left_bytes, right_bytes] = bytes_of(left, right);
    const bool is_swapped = holds_swapped_bytes(left) || holds_swapped_bytes(right);
    if (is_swapped) ++swapped_;
    if (!is_swapped && (holds_mosaic(left_bytes) || holds_mosaic(right_bytes))) ++mosaics_;
  }
  const std::uint64_t digests[2] = {digest_of(left), digest_of(right)};
  for (const int side : {0, 1}) {
    const bool stands_still = digests[side] == seen_[side] && digests[1 - side] != seen_[1 - side];
    const bool is_of_one_value = is_plain(side == 0 ? left : right);
    if (is_of_one_value) ++plain_[side];
    if (frames_ > 0 && stands_still && !is_of_one_value) ++frozen_[side];
    if (side == 0 && digests[0] == digests[1] && !is_of_one_value) ++same_;
  }
  std::copy(std::begin(digests), std::end(digests), seen_);
  size_ = left.size();
  density_ += report.density;
  if (holds_8_bits_in_16(left)) ++narrow_;
  if (std::abs(report.vertical_offset_px) >= kFarRows_px) ++far_rows_;
  if (frames_++ > 0 && calibration_ && !has_motion) ++without_motion_;
}

std::string InputCheck::text() const {
  std::string text;
  if (frames_ == 0) return text;
  const double density = density_ / static_cast<double>(frames_);
  if (density < kMinDensity) append(text, formatted("density %.0f %% in the mean", 100 * density));
  if (2 * without_motion_ > frames_ - 1)
    append(text, formatted("no motion in %zu of %zu frames", without_motion_, frames_ - 1));
  if (2 * mosaics_ > looks_)
    append(text, "the images are mosaics of colour sensors (Bayer: convert them to grey first)");
  if (2 * swapped_ > looks_)
    append(text, "both bytes of each pixel are exchanged (swap them: PNG has the high one first)");
  if (narrow_ == frames_) append(text, "values of 8 bits in images of 16");
  if (2 * far_rows_ > frames_) {
    append(text, formatted("rows of the two views lie %g px apart, the most that is corrected, or farther",
                           static_cast<double>(EGOSGM_MAX_OFFSET_PX)));
  }
  if (same_ > 0) {
    append(text,
           formatted("the left and the right image are the same in %zu of %zu frames (give those of both cameras)",
                     same_, frames_));
  }
  for (const auto& [side, name] : {std::pair{0, "left"}, {1, "right"}}) {
    if (plain_[side] > 0) {
      append(text, formatted("the %s image is of one value in %zu frames (the camera was covered, dark or off)", name,
                             plain_[side]));
    }
    if (frozen_[side] == 0) continue;
    append(text,
           formatted("the %s image is that of the frame before in %zu frames, and the other one is not (these are "
                     "of other moments: leave them out)",
                     name, frozen_[side]));
  }
  if (nearer_.near_share > 0) {
    append(text, formatted("%.0f %% of the image is nearer than the range (--disparities %d)", 100 * nearer_.near_share,
                           nearer_.disparities));
  }
  // Beyond infinity is nothing but mismatches, and what cameras see whose images were exchanged.
  if (farther_.far_share > 0 && calibration_ && least_ > -calibration_->doffs_px) {
    append(text, formatted("%.0f %% of the image is farther than the range (--min-disparity %d)",
                           100 * farther_.far_share, farther_.min_disparity));
  }
  if (!calibration_) return text;
  if (const auto suspicion = suspect_calibration(*calibration_, size_)) {
    append(text, suspicion->what + " (" + suspicion->remedy + ")");
  }
  return text;
}

}  // namespace egosgm::vision
