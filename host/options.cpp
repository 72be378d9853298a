// SPDX-License-Identifier: Apache-2.0
// The public options: one table of what each is.
#include "egosgm/options.h"

#include <algorithm>

#include "host/method_options.h"
#include "host/option_text.h"

namespace egosgm {
namespace {

using namespace option_text;  // NOLINT(google-build-using-namespace)

template <typename Options, typename Visit>
void for_each(Options& o, Visit&& visit) {
  visit(OptionText{"preset", "Chooses the constants of the method, and where the other options start from.", "",
                   "default, paper", "Set paper to compare with Fućek et al. (2017). Put it before other options."},
        o.preset);
  visit(
      OptionText{
          "disparities", "Number D of disparities that a pixel can have.", "px", "1 to 4096",
          "Raise it if near objects are cut off: the nearest depth is fx * baseline / D. Lower it if nothing is near."},
      o.disparities);
  visit(OptionText{"min_disparity", "Least disparity: the range is [min_disparity, min_disparity + D).", "px",
                   "-16384 to 16384", "Set it below 0 if the cameras converge or rectification left an offset."},
        o.min_disparity);
  visit(OptionText{"temporal", "Predict each frame from the one before.", "", "true, false",
                   "Set it to false if most of the scene moves, or to match single pairs."},
        o.temporal);
  visit(OptionText{"track_right", "Predict, match and filter the right view as well.", "", "true, false",
                   "Set it to false if time counts more than errors."},
        o.track_right);
  visit(OptionText{"keep_predicted", "A pixel without a measurement keeps its prediction.", "", "true, false",
                   "Set it to false if you want only what this frame confirms."},
        o.keep_predicted);
  visit(OptionText{"coarse_match", "Also match at a quarter of the resolution, without the prediction.", "",
                   "true, false", "Set it to false to save time where nothing moves by itself."},
        o.coarse_match);
  visit(OptionText{"vertical_alignment",
                   "Estimate how far the rows of the two views are off, and resample the right one.", "", "true, false",
                   "Set it to false if your rectification is exact, as for rendered images."},
        o.vertical_alignment);
  visit(OptionText{"cost", "Matching cost of a pixel pair: Hamming distance of codes, or sum of absolute differences.",
                   "", "census9x7, census5x5, sad3x3",
                   "Set census5x5 if thin objects are lost; sad3x3 needs cameras of equal brightness."},
        o.cost);
  visit(OptionText{"paths", "Paths of the semi-global aggregation.", "", "4, 8",
                   "Set 8 if single pairs count more than time."},
        o.paths);
  visit(OptionText{"p1", "Penalty of a step of one disparity between neighbours.", "cost", "0 to p2",
                   "Raise it for smooth surfaces without texture; lower it for slanted ones."},
        o.p1);
  visit(OptionText{"p2", "Penalty of a larger step; it is lower where the image has an edge.", "cost", "0 to 190",
                   "Lower it if thin objects are lost."},
        o.p2);
  visit(OptionText{"max_speckle_px",
                   "Connected regions of at most this size are dropped, in frames without a prediction.", "pixels",
                   "0 (none) or more", "Raise it if small islands of wrong disparity stay."},
        o.max_speckle_px);
  visit(OptionText{"max_memory_mib", "Device memory for path sums; a larger image is matched in horizontal stripes.",
                   "MiB", "0 (what the device has) or more", "Set it if other programs need the device's memory."},
        o.max_memory_mib);
  visit(OptionText{"left_right_px", "Largest difference between the disparities of the two views.", "px", "0 or more",
                   "Lower it if wrong pixels stay; raise it if too many are missing."},
        o.left_right_px);
  visit(OptionText{"search_sigmas", "Half-width of a predicted pixel's search, in standard deviations.", "",
                   "0 or more", "Raise it if your poses or calibration are worse than their covariance says."},
        o.search_sigmas);
  visit(OptionText{"min_half_width_px", "A predicted pixel searches at least this far to either side.", "px",
                   "0 or more", "Raise it if the frame rate is low or turns are fast."},
        o.min_half_width_px);
  visit(OptionText{"process_noise_px2", "Variance that a frame adds to every prediction (q, eq. 6).", "px^2",
                   "0 or more", "Lower it if your poses are exact; raise it if they are not."},
        o.process_noise_px2);
  visit(OptionText{"gate_px", "Where prediction and measurement differ by more, the measurement counts.", "px",
                   "0 (average always) or more", "Lower it if moving objects smear; raise it if the map flickers."},
        o.gate_px);
}

/// Before the names of constants, which benches set as they set options.
constexpr std::string_view kConstants = "constants.";

void set_constant(PipelineOptions& options, std::string_view name, std::string_view value) {
  MethodOptions any;
  set_parameter(any, name, value);  // throws where it does not exist, or the value does not parse
  for (auto& [known, text] : options.constants) {
    if (known != name) continue;
    text = value;
    return;
  }
  options.constants.emplace_back(name, value);
}

/// The names of all options.
std::string names_of(const PipelineOptions& options) {
  std::string names;
  for_each(options,
           [&](const OptionText& text, const auto&) { names += (names.empty() ? "" : ", ") + std::string(text.name); });
  return names;
}

}  // namespace

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): the defaults of the parameters are written once, there
PipelineOptions::PipelineOptions() : preset(Preset::kDefault) { MethodOptions().give_options(*this); }

PipelineOptions PipelineOptions::paper() {
  PipelineOptions options;
  options.preset = Preset::kPaper;
  options.paths = 8;
  options.process_noise_px2 = 0.5f;
  options.search_sigmas = 3.0f;
  options.min_half_width_px = 0.0f;
  options.coarse_match = false;
  options.gate_px = 0.0f;
  options.vertical_alignment = false;
  options.max_speckle_px = 0;
  options.cost = MatchingCost::kSad3x3;
  options.p1 = 10;
  options.p2 = 120;
  return options;
}

void PipelineOptions::validate() const {
  expect("disparities", disparities, disparities >= 1 && disparities <= 4096, "choose 1 to 4096");
  expect("min_disparity", min_disparity, min_disparity >= -16384 && min_disparity <= 16384, "choose -16384 to 16384");
  for_each(*this, [](const OptionText& text, const auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, float>) expect_not_negative(text.name, value);
    if constexpr (std::is_enum_v<Value>) expect(text.name, value, text_of(value) != "?", "choose a named value");
  });
  expect("paths", paths, paths == 4 || paths == 8, "choose 4 or 8");
  expect("p2", p2, p2 >= 0 && p2 <= 190, "choose 0 to 190: path costs have 8 bits");
  expect("p1", p1, p1 >= 0 && p1 <= p2, "choose 0 to p2");
  expect("max_speckle_px", max_speckle_px, max_speckle_px >= 0, "choose 0 (off) or more");
  expect("max_memory_mib", max_memory_mib, max_memory_mib >= 0, "choose 0 (what the device has) or more");
  MethodOptions(*this).validate();
}

std::vector<NamedOption> list_options(const PipelineOptions& options) {
  std::vector<NamedOption> list;
  for_each(options, [&](const OptionText& text, const auto& value) { list.push_back({text.name, text_of(value)}); });
  for (const auto& [name, value] : options.constants) list.push_back({std::string(kConstants) + name, value});
  return list;
}

const std::vector<OptionText>& option_texts() {
  static const std::vector<OptionText> texts = [] {
    std::vector<OptionText> list;
    const PipelineOptions options;
    for_each(options, [&](const OptionText& text, const auto&) { list.push_back(text); });
    return list;
  }();
  return texts;
}

void set_option(PipelineOptions& options, std::string_view name, std::string_view value) {
  if (name.starts_with(kConstants)) return set_constant(options, name.substr(kConstants.size()), value);
  bool found = false;
  for_each(options, [&](const OptionText& text, auto& member) {
    if (name != text.name) return;
    found = true;
    parse(name, value, member);
  });
  if (found && name == "preset")
    options = options.preset == Preset::kPaper ? PipelineOptions::paper() : PipelineOptions();
  if (found) return;
  throw InvalidArgument("no option named \"" + std::string(name) + "\": choose from " + names_of(options));
}

}  // namespace egosgm
