// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "egosgm/export.h"
#include "egosgm/vision/evaluation.h"

namespace egosgm::vision {

// What evaluate_video counts. Counts of several frames add up.

/// Sizes of errors of a change from one frame to the next.
struct EGOSGM_EXPORT TemporalCounts {
  double sum_px = 0;
  std::int64_t pixels = 0, above_1px = 0, above_3px = 0;
  double relative_sum = 0;  // |error| / (|true change| + 0.001)
  std::int64_t relative_above_1 = 0;
  double sum_of_pair_means_px = 0;
  int pairs = 0;  // that have such pixels

  TemporalCounts& operator+=(const TemporalCounts& other);
};

/// A figure that is the mean of each pair's own mean.
struct EGOSGM_EXPORT PairMean {
  double sum = 0;
  int pairs = 0;

  PairMean& operator+=(const PairMean& other);
  double value() const;  // NaN without pairs
};

/// Pixels with truth, and what another method has there. `both` have an estimate; `changed`: they differ by more than
/// 1 px. `gained`: the other one has none. `lost_right`: the other one's is right, and this method has none or a bad
/// one; none is as good where the truth says that nothing is there.
struct EGOSGM_EXPORT ChangeCounts {
  std::int64_t both = 0, changed = 0, worse = 0, better = 0;
  std::int64_t truth = 0, gained = 0, gained_right = 0, lost_right = 0;

  ChangeCounts& operator+=(const ChangeCounts& other);
};

/// Pixels with truth, estimate and Reason; `trusted`: of Reason::kTrusted.
struct EGOSGM_EXPORT TrustCounts {
  std::int64_t valid = 0, bad = 0, trusted = 0, trusted_bad = 0;

  TrustCounts& operator+=(const TrustCounts& other);
};

/// What is left if the least certain pixels are dropped. Share k keeps 2 * (k + 1) percent of each frame's pixels that
/// have truth, estimate and uncertainty.
struct EGOSGM_EXPORT DensityCounts {
  static constexpr int kShares = 50;
  std::array<std::int64_t, kShares> kept{}, bad{}, oracle_bad{};
  std::array<double, kShares> error_px{}, oracle_error_px{};  // sums of |error|
  /// Density k keeps 50 + 5 k percent of the pixels that have truth, or all that there are.
  static constexpr int kDensities = 11;
  std::array<std::int64_t, kDensities> kept_of_truth{}, bad_of_kept{};
  std::int64_t truth = 0;

  DensityCounts& operator+=(const DensityCounts& other);
  double ause_px() const;       // of the mean |error| [px]; NaN without pixels
  double ause_percent() const;  // of the bad pixels [percent]
};

/// Parts of the image that are looked at apart, told by truth, masks and motion of the later frame.
enum class Region { kAll, kMoving, kStill, kUncovered, kEdges, kNear, kFar, kSky };
inline constexpr std::array<const char*, 8> kRegionNames = {"all",   "moving", "still", "uncovered",
                                                            "edges", "near",   "far",   "sky"};

struct EGOSGM_EXPORT RegionCounts {
  DisparityCounts errors;
  TemporalCounts tepe, tepe_interpolated;  // same pixel
  ChangeCounts against;
  TrustCounts trust;

  RegionCounts& operator+=(const RegionCounts& other);
};

/// Of one frame and of the pair that it makes with the frame before; those of several add up.
struct EGOSGM_EXPORT VideoCounts {
  std::array<RegionCounts, kRegionNames.size()> regions;
  TemporalCounts flicker;
  PairMean tae_percent;  // pairs count twice: both directions
  TemporalCounts tepe_along_motion;
  PairMean opw_px, opw_m, rtc_1_01_percent, rtc_1_25_percent;
  DensityCounts density;

  VideoCounts& operator+=(const VideoCounts& other);
  const RegionCounts& region(Region which) const { return regions[static_cast<std::size_t>(which)]; }
};

/// Percent of each frame's pixels with truth, estimate and uncertainty that are kept, in the order of the uncertainty
/// and in the oracle's, that of the errors. NaN where there is nothing to divide by.
struct SparsificationPoint {
  double kept_percent, bad_percent, oracle_bad_percent, mae_px, oracle_mae_px;
};
EGOSGM_EXPORT std::vector<SparsificationPoint> sparsification_of(const DensityCounts& counts);

/// Percent of the pixels with truth: wanted, and reached where the method has fewer; of these, bad.
struct DensityPoint {
  double density_percent, reached_percent, bad_percent;
};
EGOSGM_EXPORT std::vector<DensityPoint> densities_of(const DensityCounts& counts);

/// A figure by the name that the program and the Python module give it. NaN where there is nothing to divide by.
struct NamedFigure {
  const char* name;
  double value;
};

/// The figures over time.
EGOSGM_EXPORT std::vector<NamedFigure> figures_of(const VideoCounts& counts);
/// The errors, TEPE, and what stands beside another method, of one region.
EGOSGM_EXPORT std::vector<NamedFigure> figures_of(const RegionCounts& counts);

}  // namespace egosgm::vision
