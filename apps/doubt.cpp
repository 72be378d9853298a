// SPDX-License-Identifier: Apache-2.0
#include "apps/doubt.h"

#include <fmt/core.h>

namespace egosgm::app {
namespace {

constexpr double kMaxBaseline_m = 5.0;
constexpr double kMinDensity = 0.5;

void append(std::string& text, const std::string& part) { text += (text.empty() ? "" : ", ") + part; }

}  // namespace

bool is_baseline_mistaken(const Calibration& calibration) { return calibration.baseline_m > kMaxBaseline_m; }

void Doubt::add(double density, bool has_motion, bool holds_8_bits_in_16) {
  density_ += density;
  if (holds_8_bits_in_16) ++narrow_;
  if (frames_++ > 0 && !has_motion) ++without_motion_;
}

std::string Doubt::text() const {
  std::string text;
  if (frames_ == 0) return text;
  const double density = density_ / static_cast<double>(frames_);
  if (density < kMinDensity) append(text, fmt::format("density {:.0f} % in the mean", 100 * density));
  if (2 * without_motion_ > frames_ - 1)
    append(text, fmt::format("no motion in {} of {} frames", without_motion_, frames_ - 1));
  if (narrow_ == frames_) append(text, "values of 8 bits in images of 16");
  if (is_baseline_mistaken(calibration_))
    append(text, fmt::format("a baseline of {:.4g} m ({})", calibration_.baseline_m, kMistakenBaseline));
  return text;
}

std::string advice_of(const std::string& doubt, const std::string& input) {
  return doubt.empty() ? "" : fmt::format("{}: `egosgm doctor {}` tells why", doubt, input);
}

}  // namespace egosgm::app
