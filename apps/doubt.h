// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include "egosgm/calibration.h"

namespace egosgm::app {

/// Whether a baseline is of no rig that stands on a vehicle: its unit was mistaken.
bool is_baseline_mistaken(const Calibration& calibration);
constexpr const char* kMistakenBaseline = "is the baseline in millimetres? baseline_m is in metres";

/// What speaks against a run's input once it is matched: a mean density below a half (maps of good input keep four
/// fifths and more), no motion in most frames that have one before them, images of 16 bits that hold 8, a mistaken
/// baseline.
class Doubt {
 public:
  explicit Doubt(const Calibration& calibration) : calibration_(calibration) {}

  void add(double density, bool has_motion, bool holds_8_bits_in_16);

  /// "density 24 % in the mean, no motion in 10 of 11 frames"; empty where nothing does.
  std::string text() const;

 private:
  const Calibration calibration_;
  double density_ = 0;  // of all frames, added up
  std::size_t frames_ = 0, without_motion_ = 0, narrow_ = 0;
};

/// The line that names `egosgm doctor` with `input`, the arguments that name the sequence; empty without a doubt.
std::string advice_of(const std::string& doubt, const std::string& input);

}  // namespace egosgm::app
