// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "egosgm/named_options.h"
#include "tests/support/expect_refused.h"

namespace egosgm {
namespace {

using testing::expect_refused;

std::map<std::string, std::string> texts(const PipelineOptions& options) {
  std::map<std::string, std::string> texts;
  for (const NamedOption& option : list_options(options)) texts[option.name] = option.value;
  return texts;
}

/// Another value that an option whose value is `text` can take; by way of what it is.
std::string another_value(const std::string& text) {
  static const std::map<std::string, std::string> kOthers{{"true", "false"},      {"false", "true"},
                                                          {"band", "full"},       {"census13x11", "census5x5"},
                                                          {"automatic", "paths"}, {"8", "4"}};
  if (const auto found = kOthers.find(text); found != kOthers.end()) return found->second;
  return text.find('.') == std::string::npos ? std::to_string(std::stoi(text) + 3) : text + "5";
}

// One value each, of every member: none of them may be missing in the list of names, or be named twice.
TEST(Options, HasANameForEveryMember) {
  const std::map<std::string, std::function<void(PipelineOptions&)>> members{
      {"disparities", [](auto& o) { o.disparities = 77; }},
      {"min_disparity", [](auto& o) { o.min_disparity = -77; }},
      {"search", [](auto& o) { o.search = SearchMode::kFull; }},
      {"temporal", [](auto& o) { o.temporal = false; }},
      {"track_right", [](auto& o) { o.track_right = true; }},
      {"forward_warp.process_noise_px2", [](auto& o) { o.forward_warp.process_noise_px2 = 77; }},
      {"forward_warp.motion_noise", [](auto& o) { o.forward_warp.motion_noise = 77; }},
      {"edge_rejection.max_jump_px", [](auto& o) { o.edge_rejection.max_jump_px = 77; }},
      {"hole_fill.max_difference_px", [](auto& o) { o.hole_fill.max_difference_px = 77; }},
      {"consistency.prediction_px", [](auto& o) { o.consistency.prediction_px = 77; }},
      {"consistency.measurement_px", [](auto& o) { o.consistency.measurement_px = 77; }},
      {"consistency.update_px", [](auto& o) { o.consistency.update_px = 77; }},
      {"consistency.read_off_px", [](auto& o) { o.consistency.read_off_px = 77; }},
      {"search_band.sigmas", [](auto& o) { o.search_band.sigmas = 77; }},
      {"search_band.min_half_width_px", [](auto& o) { o.search_band.min_half_width_px = 77; }},
      {"search_band.from_neighbours", [](auto& o) { o.search_band.from_neighbours = false; }},
      {"search_band.neighbour_min_count", [](auto& o) { o.search_band.neighbour_min_count = 77; }},
      {"search_band.neighbour_margin_px", [](auto& o) { o.search_band.neighbour_margin_px = 77; }},
      {"search_band.coarse_tolerance_px", [](auto& o) { o.search_band.coarse_tolerance_px = 77; }},
      {"search_band.coarse_margin_px", [](auto& o) { o.search_band.coarse_margin_px = 77; }},
      {"search_band.ridge_step_px", [](auto& o) { o.search_band.ridge_step_px = 77; }},
      {"coarse_match.enabled", [](auto& o) { o.coarse_match.enabled = false; }},
      {"coarse_match.p1", [](auto& o) { o.coarse_match.p1 = 77; }},
      {"coarse_match.p2", [](auto& o) { o.coarse_match.p2 = 77; }},
      {"coarse_match.p2_at_edges", [](auto& o) { o.coarse_match.p2_at_edges = 77; }},
      {"coarse_match.max_difference_px", [](auto& o) { o.coarse_match.max_difference_px = 77; }},
      {"vertical_alignment.enabled", [](auto& o) { o.vertical_alignment.enabled = false; }},
      {"vertical_alignment.gain", [](auto& o) { o.vertical_alignment.gain = 0.77f; }},
      {"banded_sgm.cost", [](auto& o) { o.banded_sgm.cost = MatchingCost::kSad3x3; }},
      {"banded_sgm.paths", [](auto& o) { o.banded_sgm.paths = 4; }},
      {"banded_sgm.p1", [](auto& o) { o.banded_sgm.p1 = 77; }},
      {"banded_sgm.p2", [](auto& o) { o.banded_sgm.p2 = 77; }},
      {"banded_sgm.p2_at_edges", [](auto& o) { o.banded_sgm.p2_at_edges = 77; }},
      {"banded_sgm.p2_slope", [](auto& o) { o.banded_sgm.p2_slope = 77; }},
      {"banded_sgm.s_max", [](auto& o) { o.banded_sgm.s_max = 77; }},
      {"banded_sgm.variance_floor_px2", [](auto& o) { o.banded_sgm.variance_floor_px2 = 77; }},
      {"banded_sgm.variance_per_step_px2", [](auto& o) { o.banded_sgm.variance_per_step_px2 = 77; }},
      {"banded_sgm.variance_per_square_px2", [](auto& o) { o.banded_sgm.variance_per_square_px2 = 77; }},
      {"banded_sgm.scheduling", [](auto& o) { o.banded_sgm.scheduling = Scheduling::kPaths; }},
      {"banded_sgm.max_memory_mib", [](auto& o) { o.banded_sgm.max_memory_mib = 77; }},
      {"median_filter.enabled", [](auto& o) { o.median_filter.enabled = false; }},
      {"sad_check.max_difference", [](auto& o) { o.sad_check.max_difference = 77; }},
      {"speckle_removal.max_size_px", [](auto& o) { o.speckle_removal.max_size_px = 77; }},
      {"speckle_removal.max_difference_px", [](auto& o) { o.speckle_removal.max_difference_px = 77; }},
      {"kalman_update.gate_px", [](auto& o) { o.kalman_update.gate_px = 77; }},
      {"kalman_update.keep_predicted", [](auto& o) { o.kalman_update.keep_predicted = false; }},
      {"kalman_update.ask_neighbours", [](auto& o) { o.kalman_update.ask_neighbours = false; }},
      {"kalman_update.innovation_sigmas", [](auto& o) { o.kalman_update.innovation_sigmas = 77; }},
      {"kalman_update.min_variance_px2", [](auto& o) { o.kalman_update.min_variance_px2 = 77; }},
      {"dynamic_map.enabled", [](auto& o) { o.dynamic_map.enabled = true; }},
      {"prediction_check.enabled", [](auto& o) { o.prediction_check.enabled = false; }},
      {"output_variance.enabled", [](auto& o) { o.output_variance.enabled = false; }},
      {"output_variance.scale", [](auto& o) { o.output_variance.scale = 77; }},
      {"output_variance.roughness_weight", [](auto& o) { o.output_variance.roughness_weight = 77; }},
      {"output_variance.jump_weight", [](auto& o) { o.output_variance.jump_weight = 77; }},
      {"dynamic_map.min_difference_px", [](auto& o) { o.dynamic_map.min_difference_px = 77; }},
  };
  const auto defaults = texts({});
  EXPECT_EQ(list_options({}).size(), defaults.size()) << "a name is there twice";
  for (const auto& [name, text] : defaults) EXPECT_TRUE(members.contains(name)) << name << " is not in this test";
  for (const auto& [name, change] : members) {
    PipelineOptions options;
    change(options);
    auto changed = texts(options);
    ASSERT_TRUE(changed.contains(name)) << name;
    EXPECT_NE(changed[name], defaults.at(name)) << name;
    changed[name] = defaults.at(name);
    EXPECT_EQ(changed, defaults) << name << " changes another one";
  }
}

TEST(Options, AreSetByTheTextsThatTheyAreListedAs) {
  const auto defaults = texts({});
  for (const auto& [name, text] : defaults) {
    PipelineOptions options;
    const std::string other = another_value(text);
    set_option(options, name, other);
    auto expected = defaults;
    expected[name] = other;
    EXPECT_EQ(texts(options), expected) << name;
    set_option(options, name, text);
    EXPECT_EQ(texts(options), defaults) << name;
  }
}

TEST(Options, OfAPresetCanBeSetOneByOne) {
  PipelineOptions paper;
  for (const NamedOption& option : list_options(PipelineOptions::paper())) set_option(paper, option.name, option.value);
  EXPECT_EQ(texts(paper), texts(PipelineOptions::paper()));
  EXPECT_NE(texts(paper), texts({}));
}

TEST(Options, KeepEveryBitOfANumber) {
  for (const float value : {0.1f, 1.0f / 3, 1e-30f, 3.4e38f, 16777217.0f, std::nextafter(2.0f, 3.0f)}) {
    PipelineOptions options, copy;
    options.kalman_update.gate_px = value;
    set_option(copy, "kalman_update.gate_px", texts(options)["kalman_update.gate_px"]);
    EXPECT_EQ(copy.kalman_update.gate_px, value);
  }
}

TEST(Options, TakeEveryNameOfAChoice) {
  PipelineOptions options;
  for (const std::string cost : {"census13x11", "census9x7", "census5x5", "sad3x3"}) {
    set_option(options, "banded_sgm.cost", cost);
    EXPECT_EQ(texts(options)["banded_sgm.cost"], cost);
  }
  EXPECT_EQ(options.banded_sgm.cost, MatchingCost::kSad3x3);
  for (const std::string scheduling : {"automatic", "wavefront", "paths"}) {
    set_option(options, "banded_sgm.scheduling", scheduling);
    EXPECT_EQ(texts(options)["banded_sgm.scheduling"], scheduling);
  }
  EXPECT_EQ(options.banded_sgm.scheduling, Scheduling::kPaths);
  set_option(options, "search", "full");
  EXPECT_EQ(options.search, SearchMode::kFull);
  set_option(options, "search", "band");
  EXPECT_EQ(options.search, SearchMode::kBand);
  for (const std::string yes : {"true", "on", "yes", "1"}) {
    options.temporal = false;
    set_option(options, "temporal", yes);
    EXPECT_TRUE(options.temporal) << yes;
  }
  for (const std::string no : {"false", "off", "no", "0"}) {
    options.temporal = true;
    set_option(options, "temporal", no);
    EXPECT_FALSE(options.temporal) << no;
  }
}

TEST(Options, UnknownNamesGetTheNearestOne) {
  const std::pair<const char*, const char*> cases[] = {{"banded_sgm.p3", "banded_sgm.p1 or banded_sgm.p2"},
                                                       {"p2", "coarse_match.p2 or banded_sgm.p2"},
                                                       {"matcher.p2_slope", "banded_sgm.p2_slope"},
                                                       {"gate_px", "kalman_update.gate_px"},
                                                       {"banded_sgm.path", "banded_sgm.paths"},
                                                       {"disparity", "disparities"},
                                                       {"min-disparity", "min_disparity"},
                                                       {"search_band.sigma", "search_band.sigmas"},
                                                       {"kalman.gate_px", "kalman_update.gate_px"},
                                                       {"Temporal", "temporal"},
                                                       {"speckle_removal.max_sizepx", "speckle_removal.max_size_px"}};
  for (const auto& [name, nearest] : cases) {
    PipelineOptions options;
    expect_refused([&] { set_option(options, name, "1"); },
                   {"no option named \"" + std::string(name) + "\"", "did you mean " + std::string(nearest) + "?"});
    EXPECT_EQ(texts(options), texts({})) << name;
  }
}

TEST(Options, UnknownNamesThatAreNearNoneGetNone) {
  for (const std::string name : {"", "x", "hello", "p2 = 3, and more of that"}) {
    PipelineOptions options;
    try {
      set_option(options, name, "1");
      ADD_FAILURE() << name;
    } catch (const InvalidArgument& error) {
      EXPECT_EQ(error.what(), "no option named \"" + name + "\": `egosgm run --help` lists them");
    }
  }
}

TEST(Options, RefusesTextsThatAreNoValue) {
  const auto defaults = texts({});
  for (const auto& [name, text] : defaults) {
    for (const std::string bad :
         {"", "x", "1x", "8 ", " 8", "--1", "nonsense", "1,5", "0x10", "1e999", "99999999999999999999x"}) {
      PipelineOptions options;
      expect_refused([&] { set_option(options, name, bad); }, {"option " + name + ": \"" + bad + "\" is not "});
      EXPECT_EQ(texts(options), defaults) << name;
    }
  }
  PipelineOptions options;
  expect_refused([&] { set_option(options, "disparities", "12.5"); }, {"a whole number"});
  expect_refused([&] { set_option(options, "disparities", "99999999999"); }, {"a whole number"});
  expect_refused([&] { set_option(options, "search_band.sigmas", "many"); }, {"a number"});
  expect_refused([&] { set_option(options, "temporal", "maybe"); }, {"on or off"});
  expect_refused([&] { set_option(options, "search", "Band"); }, {"one of band, full"});
  expect_refused([&] { set_option(options, "banded_sgm.cost", "census"); },
                 {"one of census13x11, census9x7, census5x5, sad3x3"});
  expect_refused([&] { set_option(options, "banded_sgm.scheduling", ""); }, {"one of automatic, wavefront, paths"});
}

TEST(Options, PresetsAreValid) {
  EXPECT_NO_THROW(PipelineOptions().validate());
  EXPECT_NO_THROW(PipelineOptions::paper().validate());
}

TEST(Options, PaperChoosesAsThePaperDoes) {
  const PipelineOptions paper = PipelineOptions::paper();
  EXPECT_FALSE(paper.search_band.from_neighbours) << "unpredicted pixels search everything";
  EXPECT_EQ(paper.search_band.sigmas, 3);
  EXPECT_EQ(paper.search_band.min_half_width_px, 0);
  EXPECT_GT(paper.forward_warp.process_noise_px2, 0) << "a constant q,";
  EXPECT_EQ(paper.forward_warp.motion_noise, 0) << "and nothing else";
  EXPECT_EQ(paper.kalman_update.gate_px, 0) << "all is averaged,";
  EXPECT_EQ(paper.kalman_update.innovation_sigmas, 0) << "by the variances as they are";
  EXPECT_FALSE(paper.output_variance.enabled) << "the variance is the filter's";
  EXPECT_EQ(paper.banded_sgm.p2, PipelineOptions().banded_sgm.p2)
      << "the matcher, which the paper leaves open, is the default's";
  EXPECT_EQ(paper.banded_sgm.paths, 8);
  EXPECT_EQ(paper.search, SearchMode::kBand);
  EXPECT_TRUE(paper.temporal);
}

TEST(Options, RangesEndWhereTheyAreSaidTo) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> allowed{
      {"disparities", {"1", "4096"}},
      {"min_disparity", {"-16384", "16384"}},
      {"search_band.neighbour_min_count", {"1", "2147483647"}},
      {"vertical_alignment.gain", {"0", "1"}},
      {"banded_sgm.paths", {"4", "8"}},
      {"banded_sgm.p1", {"0", "170"}},
      {"banded_sgm.p2", {"10", "190"}},
      {"banded_sgm.p2_at_edges", {"0", "190"}},
      {"banded_sgm.p2_slope", {"0", "255"}},
      {"banded_sgm.s_max", {"1", "32767"}},
      {"banded_sgm.max_memory_mib", {"0", "2147483647"}},
      {"speckle_removal.max_size_px", {"0", "2147483647"}}};
  for (const auto& [name, values] : allowed) {
    for (const std::string& value : values) {
      PipelineOptions options;
      set_option(options, name, value);
      EXPECT_NO_THROW(options.validate()) << name << " " << value;
    }
  }
  const std::vector<std::pair<std::string, std::vector<std::string>>> refused{
      {"disparities", {"0", "-1", "4097", "-2147483648"}},
      {"min_disparity", {"-16385", "16385", "2147483647", "-2147483648"}},
      {"search_band.neighbour_min_count", {"0", "-1"}},
      {"vertical_alignment.gain", {"1.0001"}},
      {"banded_sgm.paths", {"0", "1", "5", "16", "-8"}},
      {"banded_sgm.p1", {"-1", "171"}},
      {"banded_sgm.p2", {"-1", "191"}},
      {"banded_sgm.p2_at_edges", {"-1", "191"}},
      {"banded_sgm.p2_slope", {"-1", "256"}},
      {"banded_sgm.s_max", {"0", "32768"}},
      {"banded_sgm.max_memory_mib", {"-1"}},
      {"banded_sgm.variance_floor_px2", {"0"}},
      {"speckle_removal.max_size_px", {"-1"}}};
  for (const auto& [name, values] : refused) {
    for (const std::string& value : values) {
      PipelineOptions options;
      set_option(options, name, value);
      expect_refused([&] { options.validate(); }, {"option " + name + " is " + value + ": choose "});
    }
  }
}

bool takes_fractions(const std::string& name) {
  try {
    PipelineOptions options;
    set_option(options, name, "0.5");
    return true;
  } catch (const InvalidArgument&) {
    return false;
  }
}

TEST(Options, NumbersAreFiniteAndNotNegative) {
  int floats = 0;
  for (const auto& [name, text] : texts({})) {
    if (!takes_fractions(name)) continue;
    ++floats;
    for (const std::string bad : {"-0.5", "-1e-30", "nan", "inf", "-inf"}) {
      PipelineOptions options;
      set_option(options, name, bad);
      expect_refused([&] { options.validate(); }, {"option " + name + " is ", ": choose "});
    }
  }
  EXPECT_GT(floats, 15);
}

}  // namespace
}  // namespace egosgm
