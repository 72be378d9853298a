// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/pipeline.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "host/method_options.h"
#include "tests/reference/banded_sgm.h"
#include "tests/reference/census.h"
#include "tests/reference/coarse_match.h"
#include "tests/reference/consistency_check.h"
#include "tests/reference/dynamic_map.h"
#include "tests/reference/edge_rejection.h"
#include "tests/reference/evidence.h"
#include "tests/reference/forward_warp.h"
#include "tests/reference/hole_fill.h"
#include "tests/reference/kalman_update.h"
#include "tests/reference/median_filter.h"
#include "tests/reference/method.h"
#include "tests/reference/output_variance.h"
#include "tests/reference/present_rows.h"
#include "tests/reference/reasons.h"
#include "tests/reference/right_map.h"
#include "tests/reference/row_interpolation.h"
#include "tests/reference/sad_check.h"
#include "tests/reference/speckle_removal.h"
#include "tests/reference/step_penalties.h"
#include "tests/reference/textureless_regions.h"
#include "tests/reference/weighted_median.h"

namespace egosgm::reference {
namespace {

/// How far apart values are that differ by one of the 255 levels that nearly all pixels fill.
float grey_step(int width, const Images& images) {
  const std::size_t rows_apart = images.bits == 8 ? 16 : 1;
  std::vector<int> greys;
  for (std::size_t i = 0; i < images.greys.size(); ++i) {
    const std::size_t row = i % (images.greys.size() / 2) / width;
    if (row % rows_apart == 0) greys.push_back(images.greys[i]);
  }
  std::sort(greys.begin(), greys.end());
  const auto above = [&](std::size_t part) { return greys[greys.size() - 1 - greys.size() / part]; };
  const int low = greys[greys.size() / 2000];
  const int high = above(2000) / 4 > above(100) ? above(100) : above(2000);
  const auto step_of = [](int largest) {
    int step = 1;
    while (largest / step > 255) step *= 2;
    return step;
  };
  if (high == low || (high - low) / step_of(high) >= 64) return static_cast<float>(step_of(high));
  return static_cast<float>(step_of(high - low)) / static_cast<float>(std::max(1, 255 / (high - low)));
}

}  // namespace

Pipeline::Pipeline(shared::ImageSize size, const MethodOptions& options, int code_padding)
    : size_(size), range_{options.min_disparity, options.disparities}, options_(options), code_padding_(code_padding) {}

void Pipeline::reset() {
  belief_.reset();
  greys_.clear();
  no_belief_reason_ = "reset";
  offset_ = {};
  has_offset_ = false;
}

Frame Pipeline::process(const Images& images, const std::optional<ViewMotions>& motions) {
  Frame frame;
  frame.unpredicted = !options_.temporal ? "not temporal" : !belief_ ? no_belief_reason_ : !motions ? "no motion" : "";
  const bool has_prediction = frame.unpredicted.empty();
  frame.tracked_views = options_.track_right ? 2 : 1;
  if (has_prediction) {
    frame.row_step = row_step();
  }
  if (has_prediction) predict(*motions, frame);

  const int passes = options_.vertical_alignment.enabled && !has_offset_ ? 2 : 1;
  for (int pass = 0; pass < passes; ++pass) {
    const VerticalOffset known = pass == 0 ? offset_ : frame.passes.back().offset;
    frame.vertical_offset_px = known.terms_px[0];
    frame.passes.push_back(match(images, frame, known));
  }
  const bool fuses = has_prediction || has_evidence();
  if (fuses) update(images, has_prediction && motions->stand, frame);

  frame.result = fuses ? frame.updated : frame.passes.back().measured;
  frame.evidence = frame.fused.evidence;
  frame.output = frame.result.disparity;
  const int step = frame.row_step;
  if (has_evidence()) {
    testing::HostMaps belief = frame.result;
    belief.evidence = frame.evidence;
    frame.output =
        textureless_regions(size_, frame.passes.back().images, step, confirmed(size_, belief, !options_.track_right));
  }
  const testing::HostMaps output =
      row_interpolation(size_, step,
                        {frame.output, output_variance(size_, step, options_.output_variance, frame.output,
                                                       frame.result, frame.passes.back().measured)});
  frame.output = output.disparity;
  frame.output_variance = output.variance;
  frame.dynamic.assign(static_cast<std::size_t>(size_.width) * size_.height, 0);
  if (has_prediction) {
    frame.dynamic = dynamic_map(size_, {greys_, bits_, belief_->disparity}, {images.greys, images.bits, frame.output},
                                motions->left_back);
  }
  frame.reasons = explain(images, frame);
  if (!options_.temporal) return frame;
  offset_ = frame.passes.back().offset;
  has_offset_ = true;
  belief_ = row_interpolation(size_, step, frame.result);
  belief_->evidence = frame.evidence;
  greys_ = images.greys;
  bits_ = images.bits;
  return frame;
}

int Pipeline::row_step() const {
  return options_.search == SearchMode::kBand && has_evidence() ? options_.banded_sgm.row_step : 1;
}

bool Pipeline::has_evidence() const {
  return options_.evidence.enabled && options_.banded_sgm.cost == MatchingCost::kCensus9x7;
}

std::vector<std::uint8_t> Pipeline::explain(const Images& images, const Frame& frame) const {
  const Pass& pass = frame.passes.back();
  return reasons(size_, options_,
                 {.images = pass.images,
                  .white = images.bits == 8 ? 255 : 65535,
                  .grey_step = grey_step(size_.width, images),
                  .codes = pass.codes,
                  .code_padding = code_padding_,
                  .warped = frame.warped.disparity,
                  .hidden = frame.predicted.hidden,
                  .row_step = frame.row_step,
                  .consistent = pass.consistent.disparity,
                  .measured = pass.measured.disparity,
                  .belief = {frame.output, frame.result.variance},
                  .doubtful = frame.fused.doubtful,
                  .evidence = has_evidence() ? frame.evidence : std::vector<std::uint8_t>{},
                  .block_evidence = frame.block_evidence});
}

void Pipeline::predict(const ViewMotions& motions, Frame& frame) const {
  const int step = frame.row_step;
  shared::DisparityMotion left = motions.left, right = motions.right;
  left.row_step = right.row_step = step;
  frame.warped = forward_warp(size_, range_, left, right, options_.forward_warp.process_noise_px2, *belief_);
  const float max_jump_px = options_.edge_rejection.max_jump_px;
  const ConsistencyCheckOptions& check = options_.consistency;
  if (max_jump_px > 0) frame.without_edges = edge_rejection(size_, max_jump_px, frame.warped, step);
  frame.predicted = hole_fill(size_, options_.hole_fill.max_difference_px,
                              max_jump_px > 0 ? frame.without_edges : frame.warped, step);
  if (!options_.track_right || !check.checks_prediction) return;
  frame.filled = frame.predicted;
  frame.predicted = consistency_check(size_, check.update_px, check.keep_unseen, frame.filled, step);
}

namespace {

/// Codes at a quarter of the resolution, and those of what is alike.
std::pair<ViewCodes, ViewCodes> coarse_codes(shared::ImageSize size, const std::vector<int>& images, int bits) {
  const shared::ImageSize coarse{(size.width + 3) / 4, (size.height + 3) / 4};
  const std::vector<std::uint16_t> shrunken = shrink(size, images, bits);
  const auto middle = shrunken.begin() + static_cast<std::ptrdiff_t>(shrunken.size() / 2);
  const std::vector<std::uint16_t> left(shrunken.begin(), middle), right(middle, shrunken.end());
  const MatchingCost census = MatchingCost::kCensus9x7;
  return {{coarse, {codes(coarse, left, 16, census), codes(coarse, right, 16, census)}},
          {coarse, {alike_codes(coarse, left), alike_codes(coarse, right)}}};
}

}  // namespace

Pass Pipeline::match(const Images& images, const Frame& frame, const VerticalOffset& known) const {
  const BandedSgmOptions& sgm = options_.banded_sgm;
  const bool everything = frame.predicted.disparity.empty() || options_.search == SearchMode::kFull;
  const bool reads_off = !frame.predicted.disparity.empty() && !options_.track_right;
  const int step = frame.row_step;
  Pass pass;
  pass.images = resample(size_, known, images.greys);
  const bool fuses = !frame.predicted.disparity.empty() || has_evidence();
  if (fuses && options_.search == SearchMode::kBand && options_.coarse_match.enabled) {
    pass.coarse = coarse_match(size_, options_, pass.images, images.bits);
    std::tie(pass.coarse_codes, pass.coarse_alike) = coarse_codes(size_, pass.images, images.bits);
  }
  pass.band = everything ? full_range(size_, range_, frame.predicted.disparity)
                         : search_band(size_, range_, options_.search_band, frame.predicted, pass.coarse, step);

  const auto middle = pass.images.begin() + static_cast<std::ptrdiff_t>(pass.images.size() / 2);
  const std::vector<std::uint64_t> both[2] = {codes(size_, {pass.images.begin(), middle}, images.bits, sgm.cost),
                                              codes(size_, {middle, pass.images.end()}, images.bits, sgm.cost)};
  pass.view_codes = {size_, {both[0], both[1]}};
  pass.codes = padded_codes(size_, both[0], both[1], code_padding_, sgm.cost);
  const std::vector<std::uint16_t> values(pass.images.begin(), pass.images.end());
  pass.penalties = step_penalties(size_, values, images.bits, sgm, step);
  pass.greys = values;
  for (std::uint16_t& value : pass.greys) value = static_cast<std::uint16_t>(value >> (images.bits - 8));
  pass.matched = banded_sgm(size_, range_, sgm, both, pass.greys, pass.band.bands, reads_off, step);
  pass.smoothed = options_.median_filter.enabled ? median_filter(size_, pass.matched, step) : pass.matched;
  const ConsistencyCheckOptions& check = options_.consistency;
  pass.consistent =
      consistency_check(size_, reads_off ? check.read_off_px : check.measurement_px, false, pass.smoothed, step);
  const bool judges_by_evidence = !frame.predicted.disparity.empty() && has_evidence();
  pass.measured = pass.consistent;
  if (!judges_by_evidence) pass.measured = speckle_removal(size_, options_.speckle_removal, pass.consistent);
  if (!judges_by_evidence && reads_off) {
    const std::ptrdiff_t right = static_cast<std::ptrdiff_t>(pass.measured.disparity.size() / 2);
    std::copy(pass.consistent.disparity.begin() + right, pass.consistent.disparity.end(),
              pass.measured.disparity.begin() + right);
  }
  pass.offset = known;
  if (options_.vertical_alignment.enabled) {
    pass.offset = estimate_offset(size_, options_.vertical_alignment.gain, pass.images, images.bits == 8 ? 1 : 256,
                                  pass.measured.disparity, known);
  }
  return pass;
}

void Pipeline::update(const Images& images, bool stands, Frame& frame) const {
  const Pass& pass = frame.passes.back();
  const bool has_prediction = !frame.predicted.disparity.empty();
  const testing::HostMaps predicted = has_prediction ? frame.predicted : testing::empty_maps(size_);
  std::optional<FrameEvidence> evidence;
  if (has_evidence()) {
    std::optional<CoarseView> coarse;
    if (!pass.coarse.empty()) coarse = CoarseView{pass.coarse_codes, pass.coarse_alike, pass.coarse};
    evidence =
        FrameEvidence{has_prediction ? frame.warped.evidence : std::vector<std::uint8_t>(predicted.disparity.size(), 0),
                      block_evidence(options_.kalman_update.gate_px, pass.view_codes, coarse, predicted, pass.measured),
                      images.greys == greys_, stands && coarse.has_value(), frame.row_step};
    frame.block_evidence = evidence->blocks.evidence;
  }
  const int step = frame.row_step;
  frame.fused = kalman_update(size_, options_.kalman_update, predicted, pass.measured, evidence ? &*evidence : nullptr);
  frame.fused = without_absent_rows(size_, step, frame.fused);
  frame.fused_smoothed =
      options_.median_filter.enabled ? weighted_median(size_, range_, pass.greys, frame.fused, step) : frame.fused;
  if (!options_.track_right) {
    frame.fused_smoothed =
        right_map(size_, range_.min, options_.consistency.update_px, pass.measured, frame.fused_smoothed);
  }
  frame.fused_consistent = consistency_check(size_, options_.consistency.update_px, options_.consistency.keep_unseen,
                                             frame.fused_smoothed, step);
  frame.updated = options_.sad_check.max_difference > 0 ? sad_check(size_, options_.sad_check, pass.images,
                                                                    images.bits == 8 ? 1 : 257, frame.fused_consistent)
                                                        : frame.fused_consistent;
}

}  // namespace egosgm::reference
