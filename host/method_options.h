// SPDX-License-Identifier: Apache-2.0
// The parameters of the stages: one aggregate a stage, the method's are their sum. Users choose a few of them through
// PipelineOptions; a preset chooses the others, and the benches may. A default is written here and nowhere else.
#pragma once

#include <string_view>
#include <vector>

#include "egosgm/named_options.h"
#include "egosgm/tuning.h"
#include "host/method_options.h"

namespace egosgm {

/// kBand: search where the prediction says (the method). kFull: search the whole range in every frame.
enum class SearchMode { kBand, kFull };

struct ForwardWarpOptions {
  float process_noise_px2 = 0.01f;  // constant part of q, added to every variance (eq. 6)
  float motion_noise = 1.0f;        // factor of the other part, J Sigma J^T by the motion's covariance Sigma
};
struct EdgeRejectionOptions {
  float max_jump_px = 0.0f;  // a larger step to a neighbour drops the prediction on both sides; 0: none does
};
struct HoleFillOptions {
  float max_difference_px = 1.0f;  // gamma (eqs. 7-8): neighbours that differ by less fill the gap between them
};
struct ConsistencyCheckOptions {
  float measurement_px = 3.0f, update_px = 2.0f;  // largest left-right differences
  float read_off_px = 1.45f;                      // of the measurement, where the right view is read off
  bool checks_prediction = false;  // the prediction is checked as the update is, where both views are tracked
  bool keep_unseen = true;         // of prediction and update: what the other camera cannot see stays
};
struct CoarseMatchOptions {
  bool enabled = true;  // match at a quarter of the resolution too, so that what moves by itself is searched for
  int p1 = 8, p2 = 60, p2_at_edges = 40;  // as in BandedSgmOptions, for a census of 5x5 coarse pixels
  float max_difference_px = 1.5f;         // of the left-right check, in coarse pixels
};
struct SearchBandOptions {
  float sigmas = 2.0f;             // half-width of a predicted pixel's band, in standard deviations
  float min_half_width_px = 3.0f;  // and at least this
  bool from_neighbours = true;     // unpredicted pixels search the range of the predictions around them
  int neighbour_min_count =
      144;  // with fewer predictions than this in the 3x3 blocks around, a quarter, the whole range
  float neighbour_margin_px = 4.0f;
  // A band is widened to what CoarseMatch found, and a margin, where that lies beyond it by more than the tolerance.
  float coarse_tolerance_px = 3.0f, coarse_margin_px = 2.0f;
};
struct BandedSgmOptions {
  MatchingCost cost = MatchingCost::kCensus9x7;
  int paths = 4;  // 4 (horizontal and vertical) or 8
  int p1 = 16;    // penalty of a step of one disparity
  // Penalty of a larger step between neighbours whose grey values (8 bits) differ by g: p2 - p2_slope * g, but not
  // below p2_at_edges (nor above p2).
  int p2 = 190;  // p1 <= p2 <= 190
  int p2_at_edges = 40, p2_slope = 6;
  // With evidence, frames with a prediction match every so many-th row; of the right view they have no others.
  int row_step = 2;
  // Matching variance r = floor + n (per_step + per_square n), n = n_l + n_r the steps to both sides until the (halved)
  // path sums above the minimum add up to s_max, at most 8 a side.
  int s_max = 80;
  float variance_floor_px2 = 0.05f;
  float variance_per_step_px2 = 0.05f, variance_per_square_px2 = 0.045f;
  Scheduling scheduling = Scheduling::kAutomatic;
  // Memory for the path sums. An image that needs more is matched in horizontal stripes that overlap by 32 rows, almost
  // as well (docs/understand/reliability.md). 0: what the device has.
  int max_memory_mib = 0;
};

struct VerticalAlignmentOptions {
  bool enabled = true;  // estimate vertical offsets between the views (a quadratic), and resample the right image
  float gain = 0.1f;    // part of what a frame finds that is added to the offsets, once they are known; 0 to 1
};
struct MedianFilterOptions {
  bool enabled = true;  // of the measurement, before the left-right checks, and the weighted one of the fused map
};
struct SadCheckOptions {
  float max_difference = 0.0f;  // mean absolute grey difference of the 3x3 windows (8-bit scale); 0: no check
};
struct SpeckleRemovalOptions {
  int max_size_px = 200;           // connected regions up to this size are dropped; 0: none
  float max_difference_px = 1.0f;  // neighbours within this belong to one region
};
struct KalmanUpdateOptions {
  float gate_px = 3.0f;        // where prediction and measurement differ by more, the measurement is taken; 0: never
  bool keep_predicted = true;  // a prediction without a measurement stays, with its grown variance
  bool ask_neighbours = true;  // where most of them are off to one side, they move the prediction first
  float min_variance_px2 = 0.1f;
};
struct EvidenceOptions {
  bool enabled = true;  // what no evidence says is there dies, and what is not confirmed is not published
};
struct OutputVarianceOptions {
  bool enabled = true;  // false: the filter's variance as it is, which knows of no wrong surface
  // Weights: of the averaged variance to the power 1.5; of the squares of the distance from a plane and of jumps beside
  // [px^2].
  float scale = 1.3f, roughness_weight = 1.2f, jump_weight = 0.02f;
};

struct MethodOptions {
  int disparities = 128, min_disparity = 0;  // D >= 1 of them, from a first one of either sign on
  SearchMode search = SearchMode::kBand;
  bool temporal = true;     // false: every frame alone, full range, left-right checked (the plain matcher)
  bool track_right = true;  // predict, match, filter the right view too; false: it follows from the left one, faster

  ForwardWarpOptions forward_warp;
  EdgeRejectionOptions edge_rejection;
  HoleFillOptions hole_fill;
  ConsistencyCheckOptions consistency;
  CoarseMatchOptions coarse_match;
  SearchBandOptions search_band;
  VerticalAlignmentOptions vertical_alignment;
  BandedSgmOptions banded_sgm;
  MedianFilterOptions median_filter;
  SadCheckOptions sad_check;
  SpeckleRemovalOptions speckle_removal;
  KalmanUpdateOptions kalman_update;
  EvidenceOptions evidence;
  OutputVarianceOptions output_variance;

  MethodOptions() = default;
  /// Resolves a preset and the user's options. Throws InvalidArgument for a constant that does not exist.
  MethodOptions(const PipelineOptions& options);  // NOLINT(google-explicit-constructor)
  /// Options with which a pipeline runs exactly this, for tests and benches: the public ones, and every other
  /// parameter that differs from the preset's as a constant.
  operator PipelineOptions() const;  // NOLINT(google-explicit-constructor)
  /// Sets the public options that choose one of these parameters.
  void give_options(PipelineOptions& options) const;

  /// Throws InvalidArgument, naming the parameter, its value and what is allowed.
  void validate() const;
};

/// All parameters by name, `stage.parameter`, in the order above.
std::vector<NamedOption> list_parameters(const MethodOptions& method);

/// Sets one. Throws InvalidArgument for a name that does not exist or a value that does not parse.
void set_parameter(MethodOptions& method, std::string_view name, std::string_view value);

}  // namespace egosgm
