// SPDX-License-Identifier: Apache-2.0
// The members of DisparityCounts and DisparityMetrics in the order of reports, with their names and texts in Python.
#pragma once

#include "egosgm/vision/evaluation.h"

namespace egosgm::vision {

/// Calls visit(name, pointer to the member, text).
template <typename Visit>
void for_each_count(Visit&& visit) {
  using Counts = DisparityCounts;
  visit("truth", &Counts::truth, "");
  visit("sky", &Counts::sky, "Where the truth says that nothing is there.");
  visit("sky_valid", &Counts::sky_valid, "");
  visit("valid", &Counts::valid, "");
  visit("bad", &Counts::bad, "");
  visit("bad_1px", &Counts::bad_1px, "");
  visit("d1", &Counts::d1, "");
  visit("bad_interpolated", &Counts::bad_interpolated, "");
  visit("d1_interpolated", &Counts::d1_interpolated, "");
  visit("absolute_error_px", &Counts::absolute_error_px, "");
  visit("signed_error_px", &Counts::signed_error_px, "The sum of estimate - truth.");
}

/// Calls visit as for_each_count does.
template <typename Visit>
void for_each_metric(Visit&& visit) {
  using Metrics = DisparityMetrics;
  visit("bad_or_missing", &Metrics::bad_or_missing, "");
  visit("bad_1px", &Metrics::bad_1px, "Off by more than 1 px, or missing.");
  visit("bad_of_valid", &Metrics::bad_of_valid, "Percent of the pixels with an estimate.");
  visit("density", &Metrics::density, "Percent of the pixels with a surface.");
  visit("interpolated", &Metrics::interpolated, "After background interpolation (KITTI 2012).");
  visit("d1", &Metrics::d1, "");
  visit("d1_interpolated", &Metrics::d1_interpolated, "KITTI 2015's official figure.");
  visit("mae_px", &Metrics::mae_px, "");
  visit("mean_error_px", &Metrics::mean_error_px, "Signed: below 0, pixels look too far.");
  visit("filled", &Metrics::filled, "");
  visit("wrong_of_all", &Metrics::wrong_of_all, "What is missing does not count.");
}

}  // namespace egosgm::vision
