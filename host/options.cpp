// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cmath>

#include "egosgm/error.h"
#include "egosgm/named_options.h"
#include "host/edit_distance.h"

namespace egosgm {
namespace {

// The one list of names. Calls `visit(name, member)` in the order of options.h.
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
  visit("consistency.prediction_px", o.consistency.prediction_px);
  visit("consistency.measurement_px", o.consistency.measurement_px);
  visit("consistency.update_px", o.consistency.update_px);
  visit("consistency.read_off_px", o.consistency.read_off_px);
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
  visit("search_band.ridge_step_px", o.search_band.ridge_step_px);
  visit("vertical_alignment.enabled", o.vertical_alignment.enabled);
  visit("vertical_alignment.gain", o.vertical_alignment.gain);
  visit("banded_sgm.cost", o.banded_sgm.cost);
  visit("banded_sgm.paths", o.banded_sgm.paths);
  visit("banded_sgm.p1", o.banded_sgm.p1);
  visit("banded_sgm.p2", o.banded_sgm.p2);
  visit("banded_sgm.p2_at_edges", o.banded_sgm.p2_at_edges);
  visit("banded_sgm.p2_slope", o.banded_sgm.p2_slope);
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
  visit("kalman_update.innovation_sigmas", o.kalman_update.innovation_sigmas);
  visit("kalman_update.min_variance_px2", o.kalman_update.min_variance_px2);
  visit("dynamic_map.enabled", o.dynamic_map.enabled);
  visit("prediction_check.enabled", o.prediction_check.enabled);
  visit("output_variance.enabled", o.output_variance.enabled);
  visit("output_variance.scale", o.output_variance.scale);
  visit("output_variance.roughness_weight", o.output_variance.roughness_weight);
  visit("output_variance.jump_weight", o.output_variance.jump_weight);
  visit("dynamic_map.min_difference_px", o.dynamic_map.min_difference_px);
}

template <typename Enum>
struct Choice {
  const char* name;
  Enum value;
};
constexpr Choice<MatchingCost> choice(MatchingCost, int i) {
  constexpr Choice<MatchingCost> choices[] = {{"census13x11", MatchingCost::kCensus13x11},
                                              {"census9x7", MatchingCost::kCensus9x7},
                                              {"census5x5", MatchingCost::kCensus5x5},
                                              {"sad3x3", MatchingCost::kSad3x3}};
  return i < 4 ? choices[i] : Choice<MatchingCost>{nullptr, {}};
}
constexpr Choice<SearchMode> choice(SearchMode, int i) {
  constexpr Choice<SearchMode> choices[] = {{"band", SearchMode::kBand}, {"full", SearchMode::kFull}};
  return i < 2 ? choices[i] : Choice<SearchMode>{nullptr, {}};
}
constexpr Choice<Scheduling> choice(Scheduling, int i) {
  constexpr Choice<Scheduling> choices[] = {
      {"automatic", Scheduling::kAutomatic}, {"wavefront", Scheduling::kWavefront}, {"paths", Scheduling::kPaths}};
  return i < 3 ? choices[i] : Choice<Scheduling>{nullptr, {}};
}

std::string text_of(int value) { return std::to_string(value); }
std::string text_of(bool value) { return value ? "true" : "false"; }
std::string text_of(float value) {
  char buffer[32];
  const auto result =
      std::to_chars(buffer, buffer + sizeof buffer, value);  // the shortest that reads back to the same bits
  return {buffer, result.ptr};
}
template <typename Enum>
std::string text_of(Enum value) {
  for (int i = 0; choice(value, i).name; ++i) {
    if (choice(value, i).value == value) return choice(value, i).name;
  }
  return "?";
}

[[noreturn]] void refuse(std::string_view name, std::string_view value, const std::string& allowed) {
  throw InvalidArgument("option " + std::string(name) + ": \"" + std::string(value) + "\" is not " + allowed);
}

template <typename Number>
void parse_number(std::string_view name, std::string_view text, Number& value, const char* allowed) {
  Number parsed{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), parsed);
  if (error != std::errc() || end != text.data() + text.size()) refuse(name, text, allowed);
  value = parsed;
}
void parse(std::string_view name, std::string_view text, int& value) {
  parse_number(name, text, value, "a whole number");
}
void parse(std::string_view name, std::string_view text, float& value) { parse_number(name, text, value, "a number"); }
void parse(std::string_view name, std::string_view text, bool& value) {
  if (text == "true" || text == "on" || text == "yes" || text == "1") {
    value = true;
  } else if (text == "false" || text == "off" || text == "no" || text == "0") {
    value = false;
  } else {
    refuse(name, text, "on or off (nor true, false, yes, no, 1, 0)");
  }
}
template <typename Enum>
void parse(std::string_view name, std::string_view text, Enum& value) {
  std::string allowed;
  for (int i = 0; choice(value, i).name; ++i) {
    if (text == choice(value, i).name) {
      value = choice(value, i).value;
      return;
    }
    allowed += std::string(i ? ", " : "one of ") + choice(value, i).name;
  }
  refuse(name, text, allowed);
}

template <typename Number>
void expect(const char* name, Number value, bool allowed, const char* remedy) {
  if (!allowed) throw InvalidArgument(std::string("option ") + name + " is " + text_of(value) + ": " + remedy);
}

void expect_not_negative(const char* name, float value) {
  expect(name, value, std::isfinite(value) && value >= 0, "choose a finite number, zero or more");
}

}  // namespace

PipelineOptions PipelineOptions::paper() {
  PipelineOptions options;
  options.track_right = true;
  options.forward_warp.process_noise_px2 = 0.5f;
  options.forward_warp.motion_noise = 0.0f;
  options.edge_rejection.max_jump_px = 3.0f;
  options.search_band.sigmas = 3.0f;
  options.search_band.min_half_width_px = 0.0f;
  options.search_band.from_neighbours = false;
  options.search_band.ridge_step_px = 0.0f;
  options.coarse_match.enabled = false;
  options.kalman_update.gate_px = 0.0f;
  options.kalman_update.ask_neighbours = false;
  options.kalman_update.innovation_sigmas = 0.0f;
  options.prediction_check.enabled = false;
  options.output_variance.enabled = false;
  return options;
}

void PipelineOptions::validate() const {
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
  expect("banded_sgm.s_max", banded_sgm.s_max, banded_sgm.s_max >= 1 && banded_sgm.s_max <= 32767, "choose 1 to 32767");
  expect("banded_sgm.max_memory_mib", banded_sgm.max_memory_mib, banded_sgm.max_memory_mib >= 0,
         "choose 0 (what the device has) or more");
  expect("banded_sgm.variance_floor_px2", banded_sgm.variance_floor_px2, banded_sgm.variance_floor_px2 > 0,
         "choose a positive number");
  expect("speckle_removal.max_size_px", speckle_removal.max_size_px, speckle_removal.max_size_px >= 0,
         "choose 0 (off) or more");
}

std::vector<NamedOption> list_options(const PipelineOptions& options) {
  std::vector<NamedOption> list;
  for_each(options, [&](const char* name, const auto& value) { list.push_back({name, text_of(value)}); });
  return list;
}

void set_option(PipelineOptions& options, std::string_view name, std::string_view value) {
  const auto behind_dot = [](std::string_view text) { return text.substr(text.rfind('.') + 1); };
  const std::string_view last = behind_dot(name);
  bool found = false;
  std::string nearest;
  int least = 1 << 20;
  for_each(options, [&](const char* known, auto& member) {
    if (name == known) {
      found = true;
      parse(name, value, member);
    }
    // Of the whole, or of the part behind the dot, with another stage before it. Farther is not a typing error.
    const int of_whole = edit_distance(name, known);
    const int of_last = edit_distance(last, behind_dot(known));
    int distance = of_last * 3 < static_cast<int>(last.size()) + 3 ? of_last + (last.size() < name.size()) : 1 << 20;
    if (of_whole * 3 < static_cast<int>(name.size()) + 3) distance = std::min(distance, of_whole);
    if (distance > least || distance == 1 << 20) return;
    nearest = (distance < least ? "" : nearest + " or ") + known;
    least = distance;
  });
  if (found) return;
  throw InvalidArgument("no option named \"" + std::string(name) + "\": " +
                        (nearest.empty() ? "`egosgm run --help` lists them" : "did you mean " + nearest + "?"));
}

}  // namespace egosgm
