// SPDX-License-Identifier: Apache-2.0
#include "host/method_options.h"

#include <algorithm>
#include <limits>

#include "host/option_text.h"

namespace egosgm {
namespace {

using namespace option_text;  // NOLINT(google-build-using-namespace)

// The one list of names. Calls `visit(name, member)` in the order of method_options.h.
template <typename Options, typename Visit>
void for_each(Options& o, Visit&& visit) {
  visit("disparities", o.disparities);
  visit("min_disparity", o.min_disparity);
  visit("search", o.search);
  visit("temporal", o.temporal);
  visit("track_right", o.track_right);
  visit("forward_warp.process_noise_px2", o.forward_warp.process_noise_px2);
  visit("forward_warp.motion_noise", o.forward_warp.motion_noise);
  visit("edge_rejection.max_jump_px", o.edge_rejection.max_jump_px);
  visit("hole_fill.max_difference_px", o.hole_fill.max_difference_px);
  visit("consistency.measurement_px", o.consistency.measurement_px);
  visit("consistency.update_px", o.consistency.update_px);
  visit("consistency.read_off_px", o.consistency.read_off_px);
  visit("consistency.checks_prediction", o.consistency.checks_prediction);
  visit("consistency.keep_unseen", o.consistency.keep_unseen);
  visit("coarse_match.enabled", o.coarse_match.enabled);
  visit("coarse_match.p1", o.coarse_match.p1);
  visit("coarse_match.p2", o.coarse_match.p2);
  visit("coarse_match.p2_at_edges", o.coarse_match.p2_at_edges);
  visit("coarse_match.max_difference_px", o.coarse_match.max_difference_px);
  visit("search_band.sigmas", o.search_band.sigmas);
  visit("search_band.min_half_width_px", o.search_band.min_half_width_px);
  visit("search_band.from_neighbours", o.search_band.from_neighbours);
  visit("search_band.neighbour_min_count", o.search_band.neighbour_min_count);
  visit("search_band.neighbour_margin_px", o.search_band.neighbour_margin_px);
  visit("search_band.coarse_tolerance_px", o.search_band.coarse_tolerance_px);
  visit("search_band.coarse_margin_px", o.search_band.coarse_margin_px);
  visit("vertical_alignment.enabled", o.vertical_alignment.enabled);
  visit("vertical_alignment.gain", o.vertical_alignment.gain);
  visit("banded_sgm.cost", o.banded_sgm.cost);
  visit("banded_sgm.paths", o.banded_sgm.paths);
  visit("banded_sgm.p1", o.banded_sgm.p1);
  visit("banded_sgm.p2", o.banded_sgm.p2);
  visit("banded_sgm.p2_at_edges", o.banded_sgm.p2_at_edges);
  visit("banded_sgm.p2_slope", o.banded_sgm.p2_slope);
  visit("banded_sgm.row_step", o.banded_sgm.row_step);
  visit("banded_sgm.s_max", o.banded_sgm.s_max);
  visit("banded_sgm.variance_floor_px2", o.banded_sgm.variance_floor_px2);
  visit("banded_sgm.variance_per_step_px2", o.banded_sgm.variance_per_step_px2);
  visit("banded_sgm.variance_per_square_px2", o.banded_sgm.variance_per_square_px2);
  visit("banded_sgm.scheduling", o.banded_sgm.scheduling);
  visit("banded_sgm.max_memory_mib", o.banded_sgm.max_memory_mib);
  visit("median_filter.enabled", o.median_filter.enabled);
  visit("sad_check.max_difference", o.sad_check.max_difference);
  visit("speckle_removal.max_size_px", o.speckle_removal.max_size_px);
  visit("speckle_removal.max_difference_px", o.speckle_removal.max_difference_px);
  visit("kalman_update.gate_px", o.kalman_update.gate_px);
  visit("kalman_update.keep_predicted", o.kalman_update.keep_predicted);
  visit("kalman_update.ask_neighbours", o.kalman_update.ask_neighbours);
  visit("kalman_update.min_variance_px2", o.kalman_update.min_variance_px2);
  visit("evidence.enabled", o.evidence.enabled);
  visit("output_variance.enabled", o.output_variance.enabled);
  visit("output_variance.scale", o.output_variance.scale);
  visit("output_variance.roughness_weight", o.output_variance.roughness_weight);
  visit("output_variance.jump_weight", o.output_variance.jump_weight);
}

/// The parameters that the public options choose, one to one. Calls `visit(option, parameter)`.
template <typename Options, typename Method, typename Visit>
void for_each_chosen(Options& o, Method& m, Visit&& visit) {
  visit(o.disparities, m.disparities);
  visit(o.min_disparity, m.min_disparity);
  visit(o.temporal, m.temporal);
  visit(o.track_right, m.track_right);
  visit(o.keep_predicted, m.kalman_update.keep_predicted);
  visit(o.coarse_match, m.coarse_match.enabled);
  visit(o.vertical_alignment, m.vertical_alignment.enabled);
  visit(o.cost, m.banded_sgm.cost);
  visit(o.paths, m.banded_sgm.paths);
  visit(o.p1, m.banded_sgm.p1);
  visit(o.p2, m.banded_sgm.p2);
  visit(o.max_speckle_px, m.speckle_removal.max_size_px);
  visit(o.max_memory_mib, m.banded_sgm.max_memory_mib);
  visit(o.left_right_px, m.consistency.measurement_px);
  visit(o.search_sigmas, m.search_band.sigmas);
  visit(o.min_half_width_px, m.search_band.min_half_width_px);
  visit(o.process_noise_px2, m.forward_warp.process_noise_px2);
  visit(o.gate_px, m.kalman_update.gate_px);
}

/// Constants that the paper's preset sets and that are no options (docs/understand/paper.md).
void choose_as_the_paper(MethodOptions& method) {
  method.forward_warp.motion_noise = 0.0f;
  method.edge_rejection.max_jump_px = 3.0f;
  method.consistency.checks_prediction = true;
  method.consistency.keep_unseen = false;
  method.consistency.update_px = std::numeric_limits<float>::infinity();  // left_right_px counts
  method.search_band.from_neighbours = false;
  method.banded_sgm.p2_slope = 0;
  method.banded_sgm.row_step = 1;
  // r = n_l + n_r.
  method.banded_sgm.s_max = 10;
  method.banded_sgm.variance_floor_px2 = 1e-6f;
  method.banded_sgm.variance_per_step_px2 = 1.0f;
  method.banded_sgm.variance_per_square_px2 = 0.0f;
  method.median_filter.enabled = false;
  method.kalman_update.ask_neighbours = false;
  method.kalman_update.min_variance_px2 = 0.0f;
  method.sad_check.max_difference = 20.0f;
  method.evidence.enabled = false;
  method.output_variance.enabled = false;
}

}  // namespace

void MethodOptions::give_options(PipelineOptions& options) const {
  for_each_chosen(options, *this, [](auto& option, const auto& parameter) { option = parameter; });
}

MethodOptions::MethodOptions(const PipelineOptions& options) {
  if (options.preset == Preset::kPaper) choose_as_the_paper(*this);
  for_each_chosen(options, *this, [](const auto& option, auto& parameter) { parameter = option; });
  consistency.update_px = std::min(consistency.update_px, options.left_right_px);
  for (const auto& [name, value] : options.constants) set_parameter(*this, name, value);
}

MethodOptions::operator PipelineOptions() const {
  PipelineOptions options;
  give_options(options);
  const std::vector<NamedOption> chosen = list_parameters(MethodOptions(options));
  const std::vector<NamedOption> wanted = list_parameters(*this);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (wanted[i].value != chosen[i].value) options.constants.emplace_back(wanted[i].name, wanted[i].value);
  }
  return options;
}

void MethodOptions::validate() const {
  expect("disparities", disparities, disparities >= 1 && disparities <= 4096, "choose 1 to 4096");
  expect("min_disparity", min_disparity, min_disparity >= -16384 && min_disparity <= 16384, "choose -16384 to 16384");
  for_each(*this, [](const char* name, const auto& value) {
    if constexpr (std::is_same_v<std::decay_t<decltype(value)>, float>) expect_not_negative(name, value);
  });
  expect("search_band.neighbour_min_count", search_band.neighbour_min_count, search_band.neighbour_min_count >= 1,
         "choose 1 or more");
  expect("coarse_match.p2", coarse_match.p2, coarse_match.p2 >= 0 && coarse_match.p2 <= 190, "choose 0 to 190");
  expect("coarse_match.p2_at_edges", coarse_match.p2_at_edges,
         coarse_match.p2_at_edges >= 0 && coarse_match.p2_at_edges <= 190, "choose 0 to 190");
  expect("coarse_match.p1", coarse_match.p1, coarse_match.p1 >= 0 && coarse_match.p1 <= coarse_match.p2,
         "choose 0 to coarse_match.p2");
  expect("vertical_alignment.gain", vertical_alignment.gain, vertical_alignment.gain <= 1, "choose 0 to 1");
  expect("banded_sgm.paths", banded_sgm.paths, banded_sgm.paths == 4 || banded_sgm.paths == 8, "choose 4 or 8");
  expect("banded_sgm.p2", banded_sgm.p2, banded_sgm.p2 >= 0 && banded_sgm.p2 <= 190,
         "choose 0 to 190: path costs have 8 bits");
  expect("banded_sgm.p2_at_edges", banded_sgm.p2_at_edges, banded_sgm.p2_at_edges >= 0 && banded_sgm.p2_at_edges <= 190,
         "choose 0 to 190");
  expect("banded_sgm.p2_slope", banded_sgm.p2_slope, banded_sgm.p2_slope >= 0 && banded_sgm.p2_slope <= 255,
         "choose 0 (the same penalty everywhere) to 255");
  expect("banded_sgm.p1", banded_sgm.p1, banded_sgm.p1 >= 0 && banded_sgm.p1 <= banded_sgm.p2,
         "choose 0 to banded_sgm.p2");
  expect("banded_sgm.row_step", banded_sgm.row_step, banded_sgm.row_step == 1 || banded_sgm.row_step == 2,
         "choose 1 or 2");
  expect("banded_sgm.s_max", banded_sgm.s_max, banded_sgm.s_max >= 1 && banded_sgm.s_max <= 32767, "choose 1 to 32767");
  expect("banded_sgm.max_memory_mib", banded_sgm.max_memory_mib, banded_sgm.max_memory_mib >= 0,
         "choose 0 (what the device has) or more");
  expect("banded_sgm.variance_floor_px2", banded_sgm.variance_floor_px2, banded_sgm.variance_floor_px2 > 0,
         "choose a positive number");
  expect("speckle_removal.max_size_px", speckle_removal.max_size_px, speckle_removal.max_size_px >= 0,
         "choose 0 (off) or more");
}

std::vector<NamedOption> list_parameters(const MethodOptions& method) {
  std::vector<NamedOption> list;
  for_each(method, [&](const char* name, const auto& value) { list.push_back({name, text_of(value)}); });
  return list;
}

void set_parameter(MethodOptions& method, std::string_view name, std::string_view value) {
  bool found = false;
  for_each(method, [&](const char* known, auto& member) {
    if (name == known) {
      found = true;
      parse(name, value, member);
    }
  });
  if (!found) throw InvalidArgument("no constant of the method is named \"" + std::string(name) + "\"");
}

}  // namespace egosgm
