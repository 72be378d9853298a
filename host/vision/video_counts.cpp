// SPDX-License-Identifier: Apache-2.0
#include "egosgm/vision/video_counts.h"

#include <limits>

#include "host/vision/add_members.h"
#include "host/vision/disparity_error.h"

namespace egosgm::vision {
namespace {

/// The area between two curves over the share that is kept (0 to 1), by the trapezoidal rule.
double area_between(const DensityCounts& counts, double SparsificationPoint::*curve,
                    double SparsificationPoint::*oracle) {
  if (counts.kept.back() == 0) return std::numeric_limits<double>::quiet_NaN();
  const std::vector<SparsificationPoint> points = sparsification_of(counts);
  double area = 0;
  for (std::size_t k = 1; k < points.size(); ++k) {
    if (counts.kept[k - 1] == 0) continue;
    const double gaps = points[k - 1].*curve - points[k - 1].*oracle + points[k].*curve - points[k].*oracle;
    area += gaps / 2 * (points[k].kept_percent - points[k - 1].kept_percent) / 100;
  }
  return area;
}

double pooled(const TemporalCounts& c) { return ratio(c.sum_px, static_cast<double>(c.pixels)); }

/// What a region stands for beside another method, and whether it knows where it is wrong.
void add_comparison(const RegionCounts& counts, std::vector<NamedFigure>& figures) {
  const ChangeCounts& change = counts.against;
  const TrustCounts& trust = counts.trust;
  figures.insert(figures.end(), {{"changed_percent", percent(change.changed, change.both)},
                                 {"harm_percent", percent(change.worse, change.changed)},
                                 {"help_percent", percent(change.better, change.changed)},
                                 {"gained_percent", percent(change.gained, change.truth)},
                                 {"gained_right_percent", percent(change.gained_right, change.gained)},
                                 {"lost_right_percent", percent(change.lost_right, change.truth)},
                                 {"wrong_of_trusted_percent", percent(trust.trusted_bad, trust.trusted)},
                                 {"trusted_of_wrong_percent", percent(trust.trusted_bad, trust.bad)}});
}

}  // namespace

TemporalCounts& TemporalCounts::operator+=(const TemporalCounts& other) {
  return add_members(*this, other, &TemporalCounts::sum_px, &TemporalCounts::pixels, &TemporalCounts::above_1px,
                     &TemporalCounts::above_3px, &TemporalCounts::relative_sum, &TemporalCounts::relative_above_1,
                     &TemporalCounts::sum_of_pair_means_px, &TemporalCounts::pairs);
}

PairMean& PairMean::operator+=(const PairMean& other) {
  return add_members(*this, other, &PairMean::sum, &PairMean::pairs);
}

double PairMean::value() const { return ratio(sum, pairs); }

ChangeCounts& ChangeCounts::operator+=(const ChangeCounts& other) {
  return add_members(*this, other, &ChangeCounts::both, &ChangeCounts::changed, &ChangeCounts::worse,
                     &ChangeCounts::better, &ChangeCounts::truth, &ChangeCounts::gained, &ChangeCounts::gained_right,
                     &ChangeCounts::lost_right);
}

TrustCounts& TrustCounts::operator+=(const TrustCounts& other) {
  return add_members(*this, other, &TrustCounts::valid, &TrustCounts::bad, &TrustCounts::trusted,
                     &TrustCounts::trusted_bad);
}

DensityCounts& DensityCounts::operator+=(const DensityCounts& other) {
  return add_members(*this, other, &DensityCounts::kept, &DensityCounts::bad, &DensityCounts::oracle_bad,
                     &DensityCounts::error_px, &DensityCounts::oracle_error_px, &DensityCounts::kept_of_truth,
                     &DensityCounts::bad_of_kept, &DensityCounts::truth);
}

double DensityCounts::ause_px() const {
  return area_between(*this, &SparsificationPoint::mae_px, &SparsificationPoint::oracle_mae_px);
}

double DensityCounts::ause_percent() const {
  return area_between(*this, &SparsificationPoint::bad_percent, &SparsificationPoint::oracle_bad_percent);
}

std::vector<SparsificationPoint> sparsification_of(const DensityCounts& counts) {
  std::vector<SparsificationPoint> points;
  for (std::size_t k = 0; k < counts.kept.size(); ++k) {
    const auto kept = static_cast<double>(counts.kept[k]);
    points.push_back({2.0 * static_cast<double>(k + 1), percent(counts.bad[k], counts.kept[k]),
                      percent(counts.oracle_bad[k], counts.kept[k]), ratio(counts.error_px[k], kept),
                      ratio(counts.oracle_error_px[k], kept)});
  }
  return points;
}

std::vector<DensityPoint> densities_of(const DensityCounts& counts) {
  std::vector<DensityPoint> points;
  for (std::size_t k = 0; k < counts.kept_of_truth.size(); ++k) {
    points.push_back({50.0 + 5.0 * static_cast<double>(k), percent(counts.kept_of_truth[k], counts.truth),
                      percent(counts.bad_of_kept[k], counts.kept_of_truth[k])});
  }
  return points;
}

RegionCounts& RegionCounts::operator+=(const RegionCounts& other) {
  return add_members(*this, other, &RegionCounts::errors, &RegionCounts::tepe, &RegionCounts::tepe_interpolated,
                     &RegionCounts::against, &RegionCounts::trust);
}

VideoCounts& VideoCounts::operator+=(const VideoCounts& other) {
  return add_members(*this, other, &VideoCounts::regions, &VideoCounts::flicker, &VideoCounts::tae_percent,
                     &VideoCounts::tepe_along_motion, &VideoCounts::opw_px, &VideoCounts::opw_m,
                     &VideoCounts::rtc_1_01_percent, &VideoCounts::rtc_1_25_percent, &VideoCounts::density);
}

std::vector<NamedFigure> figures_of(const VideoCounts& counts) {
  const RegionCounts& all = counts.region(Region::kAll);
  const TemporalCounts& along = counts.tepe_along_motion;
  std::vector<NamedFigure> figures{
      {"flicker_px", pooled(counts.flicker)},
      {"tae_vda_percent", counts.tae_percent.value()},
      {"tepe_dynamicstereo_px", pooled(all.tepe)},
      {"tepe_dynamicstereo_above_1px_percent", percent(all.tepe.above_1px, all.tepe.pixels)},
      {"tepe_dynamicstereo_above_3px_percent", percent(all.tepe.above_3px, all.tepe.pixels)},
      {"tepe_dynamicstereo_filled_px", pooled(all.tepe_interpolated)},
      {"tepe_dynamicstereo_filled_above_1px_percent",
       percent(all.tepe_interpolated.above_1px, all.tepe_interpolated.pixels)},
      {"tepe_dynamicstereo_filled_above_3px_percent",
       percent(all.tepe_interpolated.above_3px, all.tepe_interpolated.pixels)},
      {"tepe_codd_px", pooled(along)},
      {"tepe_codd_mean_of_pairs_px", ratio(along.sum_of_pair_means_px, along.pairs)},
      {"tepe_codd_above_3px_percent", percent(along.above_3px, along.pixels)},
      {"tepe_codd_relative", ratio(along.relative_sum, static_cast<double>(along.pixels))},
      {"tepe_codd_relative_above_1_percent", percent(along.relative_above_1, along.pixels)},
      {"opw_nvds_px", counts.opw_px.value()},
      {"opw_nvds_m", counts.opw_m.value()},
      {"rtc_1_01_percent", counts.rtc_1_01_percent.value()},
      {"rtc_1_25_percent", counts.rtc_1_25_percent.value()}};
  add_comparison(all, figures);
  figures.insert(figures.end(),
                 {{"ause_px", counts.density.ause_px()}, {"ause_bad_percent", counts.density.ause_percent()}});
  return figures;
}

std::vector<NamedFigure> figures_of(const RegionCounts& counts) {
  const DisparityMetrics errors = metrics_of(counts.errors);
  std::vector<NamedFigure> figures{
      {"bad_or_missing", errors.bad_or_missing},
      {"bad_of_valid", errors.bad_of_valid},
      {"density", errors.density},
      {"interpolated", errors.interpolated},
      {"mae", errors.mae_px},
      {"filled", errors.filled},
      {"wrong_of_all", errors.wrong_of_all},
      {"tepe_dynamicstereo_px", pooled(counts.tepe)},
      {"tepe_dynamicstereo_above_1px_percent", percent(counts.tepe.above_1px, counts.tepe.pixels)},
      {"tepe_dynamicstereo_above_3px_percent", percent(counts.tepe.above_3px, counts.tepe.pixels)},
      {"tepe_dynamicstereo_filled_px", pooled(counts.tepe_interpolated)}};
  add_comparison(counts, figures);
  return figures;
}

}  // namespace egosgm::vision
