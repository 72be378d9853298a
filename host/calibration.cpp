// SPDX-License-Identifier: Apache-2.0
#include "egosgm/calibration.h"

#include <cmath>
#include <string>

#include "egosgm/error.h"

namespace egosgm {
namespace {

void expect_finite(const char* name, double value) {
  if (std::isfinite(value)) return;
  throw InvalidArgument(std::string("calibration: ") + name + " is " + std::to_string(value) +
                        ": give a finite number");
}

void expect_positive(const char* name, double value, const char* remedy) {
  expect_finite(name, value);
  if (value > 0) return;
  throw InvalidArgument(std::string("calibration: ") + name + " is " + std::to_string(value) + ": " + remedy);
}

}  // namespace

void Calibration::validate() const {
  expect_positive("fx", fx, "a focal length in pixels is positive");
  expect_positive("fy", fy, "a focal length in pixels is positive");
  expect_finite("cx", cx);
  expect_finite("cy", cy);
  expect_finite("doffs_px", doffs_px);
  expect_positive("baseline_m", baseline_m, "a baseline in metres is positive; are left and right swapped?");
}

}  // namespace egosgm
