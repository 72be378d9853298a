// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>

#include "egosgm/named_options.h"
#include "host/frame_outputs.h"
#include "host/method_options.h"
#include "tests/support/expect_refused.h"

namespace egosgm {
namespace {

using testing::expect_refused;
using testing::refusal_of;
using Texts = std::map<std::string, std::string>;

Texts texts(const std::vector<NamedOption>& list) {
  Texts texts;
  for (const NamedOption& option : list) texts[option.name] = option.value;
  return texts;
}
Texts texts(const PipelineOptions& options) { return texts(list_options(options)); }
Texts parameters(const MethodOptions& method) { return texts(list_parameters(method)); }

/// Another value that an option whose value is `text` can take; by way of what it is.
std::string another_value(const std::string& text) {
  static const Texts kOthers{{"true", "false"},
                             {"false", "true"},
                             {"band", "full"},
                             {"census9x7", "census5x5"},
                             {"sad3x3", "census5x5"},
                             {"automatic", "paths"},
                             {"default", "paper"},
                             {"8", "4"},
                             {"4", "8"}};
  if (const auto found = kOthers.find(text); found != kOthers.end()) return found->second;
  return text.find('.') == std::string::npos ? std::to_string(std::stoi(text) + 3) : text + "5";
}

// One value each, of every member: none of them may be missing in the list of names, or be named twice.
TEST(Options, HasANameForEveryMember) {
  const std::map<std::string, std::function<void(PipelineOptions&)>> members{
      {"preset", [](auto& o) { o.preset = Preset::kPaper; }},
      {"disparities", [](auto& o) { o.disparities = 77; }},
      {"min_disparity", [](auto& o) { o.min_disparity = -77; }},
      {"temporal", [](auto& o) { o.temporal = false; }},
      {"track_right", [](auto& o) { o.track_right = false; }},
      {"keep_predicted", [](auto& o) { o.keep_predicted = false; }},
      {"coarse_match", [](auto& o) { o.coarse_match = false; }},
      {"vertical_alignment", [](auto& o) { o.vertical_alignment = false; }},
      {"cost", [](auto& o) { o.cost = MatchingCost::kSad3x3; }},
      {"paths", [](auto& o) { o.paths = 8; }},
      {"p1", [](auto& o) { o.p1 = 77; }},
      {"p2", [](auto& o) { o.p2 = 77; }},
      {"max_speckle_px", [](auto& o) { o.max_speckle_px = 77; }},
      {"max_memory_mib", [](auto& o) { o.max_memory_mib = 77; }},
      {"left_right_px", [](auto& o) { o.left_right_px = 77; }},
      {"search_sigmas", [](auto& o) { o.search_sigmas = 77; }},
      {"min_half_width_px", [](auto& o) { o.min_half_width_px = 77; }},
      {"process_noise_px2", [](auto& o) { o.process_noise_px2 = 77; }},
      {"gate_px", [](auto& o) { o.gate_px = 77; }},
  };
  const Texts defaults = texts(PipelineOptions());
  EXPECT_EQ(list_options({}).size(), defaults.size()) << "a name is there twice";
  EXPECT_LE(defaults.size(), 20u) << "what users cannot decide about is a constant of the method";
  for (const auto& [name, text] : defaults) EXPECT_TRUE(members.contains(name)) << name << " is not in this test";
  for (const auto& [name, change] : members) {
    PipelineOptions options;
    change(options);
    Texts changed = texts(options);
    ASSERT_TRUE(changed.contains(name)) << name;
    EXPECT_NE(changed[name], defaults.at(name)) << name;
    changed[name] = defaults.at(name);
    EXPECT_EQ(changed, defaults) << name << " changes another one";
    EXPECT_NE(parameters(options), parameters(PipelineOptions())) << name << " changes nothing of the method";
  }
}

TEST(Options, AreSetByTheTextsThatTheyAreListedAs) {
  const Texts defaults = texts(PipelineOptions());
  for (const auto& [name, text] : defaults) {
    if (name == "preset") continue;  // sets others, too
    PipelineOptions options;
    const std::string other = another_value(text);
    set_option(options, name, other);
    Texts expected = defaults;
    expected[name] = other;
    EXPECT_EQ(texts(options), expected) << name;
    set_option(options, name, text);
    EXPECT_EQ(texts(options), defaults) << name;
  }
}

TEST(Options, APresetIsSetByNameWithAllThatItChooses) {
  PipelineOptions paper;
  set_option(paper, "preset", "paper");
  EXPECT_EQ(texts(paper), texts(PipelineOptions::paper()));
  EXPECT_EQ(parameters(paper), parameters(PipelineOptions::paper()));
  EXPECT_NE(texts(paper), texts(PipelineOptions()));
  set_option(paper, "preset", "default");
  EXPECT_EQ(texts(paper), texts(PipelineOptions()));
  PipelineOptions copy;
  for (const NamedOption& option : list_options(PipelineOptions::paper())) set_option(copy, option.name, option.value);
  EXPECT_EQ(texts(copy), texts(PipelineOptions::paper())) << "the preset is listed first";
}

TEST(Options, KeepEveryBitOfANumber) {
  for (const float value : {0.1f, 1.0f / 3, 1e-30f, 3.4e38f, 16777217.0f, std::nextafter(2.0f, 3.0f)}) {
    PipelineOptions options, copy;
    options.gate_px = value;
    set_option(copy, "gate_px", texts(options)["gate_px"]);
    EXPECT_EQ(copy.gate_px, value);
  }
}

TEST(Options, TakeEveryNameOfAChoice) {
  PipelineOptions options;
  for (const std::string cost : {"census9x7", "census5x5", "sad3x3"}) {
    set_option(options, "cost", cost);
    EXPECT_EQ(texts(options)["cost"], cost);
  }
  EXPECT_EQ(options.cost, MatchingCost::kSad3x3);
  for (const auto& [yes, no] : {std::pair{"true", "false"}, {"on", "off"}, {"yes", "no"}, {"1", "0"}}) {
    set_option(options, "temporal", no);
    EXPECT_FALSE(options.temporal) << no;
    set_option(options, "temporal", yes);
    EXPECT_TRUE(options.temporal) << yes;
  }
}

TEST(Options, UnknownNamesGetThoseThatAreKnown) {
  for (const std::string name : {"", "x", "p3", "Temporal", "min-disparity", "p2 = 3, and more of that"}) {
    PipelineOptions options;
    expect_refused([&] { set_option(options, name, "1"); },
                   {"no option named \"" + name + "\": choose from preset, ", ", min_disparity, ", ", p2, "});
    EXPECT_EQ(texts(options), texts(PipelineOptions())) << name;
  }
}

TEST(Options, ConstantsOfTheMethodAreNone) {
  for (const auto& [name, value] : list_parameters({})) {
    if (texts(PipelineOptions()).contains(name)) continue;
    PipelineOptions options;
    expect_refused([&, name = name] { set_option(options, name, "1"); }, {name, ": "});
  }
}

TEST(Options, RefusesTextsThatAreNoValue) {
  const Texts defaults = texts(PipelineOptions());
  for (const auto& [name, text] : defaults) {
    for (const std::string bad :
         {"", "x", "1x", "8 ", " 8", "--1", "nonsense", "1,5", "0x10", "1e999", "99999999999999999999x"}) {
      PipelineOptions options;
      expect_refused([&, name = name] { set_option(options, name, bad); },
                     {"option " + name + ": \"" + bad + "\" is not "});
      EXPECT_EQ(texts(options), defaults) << name;
    }
  }
  PipelineOptions options;
  expect_refused([&] { set_option(options, "disparities", "12.5"); }, {"a whole number"});
  expect_refused([&] { set_option(options, "disparities", "99999999999"); }, {"a whole number of 32 bits"});
  expect_refused([&] { set_option(options, "search_sigmas", "1e300"); }, {"a number of 32 bits"});
  expect_refused([&] { set_option(options, "search_sigmas", "many"); }, {"a number"});
  expect_refused([&] { set_option(options, "temporal", "maybe"); }, {"on or off"});
  expect_refused([&] { set_option(options, "cost", "census"); }, {"one of census9x7, census5x5, sad3x3"});
  expect_refused([&] { set_option(options, "preset", "Paper"); }, {"one of default, paper"});
}

TEST(Options, PresetsAreValid) {
  EXPECT_NO_THROW(PipelineOptions().validate());
  EXPECT_NO_THROW(PipelineOptions::paper().validate());
}

TEST(Options, PaperChoosesAsThePaperDoes) {
  const MethodOptions paper = PipelineOptions::paper();
  EXPECT_TRUE(paper.temporal);
  EXPECT_TRUE(paper.track_right) << "both views are predicted,";
  EXPECT_FALSE(paper.consistency.keep_unseen) << "and what one camera alone can see is dropped";
  EXPECT_GT(paper.forward_warp.process_noise_px2, 0) << "a constant q,";
  EXPECT_EQ(paper.forward_warp.motion_noise, 0) << "and nothing else";
  EXPECT_GT(paper.edge_rejection.max_jump_px, 0) << "predictions beside jumps are dropped";
  EXPECT_GT(paper.hole_fill.max_difference_px, 0) << "and gaps filled";

  EXPECT_EQ(paper.search, SearchMode::kBand);
  EXPECT_EQ(paper.search_band.sigmas, 3);
  EXPECT_EQ(paper.search_band.min_half_width_px, 0);
  EXPECT_FALSE(paper.search_band.from_neighbours) << "unpredicted pixels search everything";
  EXPECT_FALSE(paper.coarse_match.enabled);

  EXPECT_EQ(paper.banded_sgm.cost, MatchingCost::kSad3x3) << "a window of 3x3";
  EXPECT_EQ(paper.banded_sgm.paths, 8);
  EXPECT_EQ(paper.banded_sgm.p2_slope, 0) << "one P2";
  EXPECT_EQ(paper.banded_sgm.s_max, 10);
  EXPECT_LT(paper.banded_sgm.variance_floor_px2, 1e-5f) << "r = n_l + n_r,";
  EXPECT_EQ(paper.banded_sgm.variance_per_step_px2, 1);
  EXPECT_EQ(paper.banded_sgm.variance_per_square_px2, 0);
  EXPECT_FALSE(paper.median_filter.enabled);
  EXPECT_EQ(paper.speckle_removal.max_size_px, 0);
  EXPECT_FALSE(paper.vertical_alignment.enabled);

  EXPECT_EQ(paper.kalman_update.gate_px, 0) << "all is averaged,";
  EXPECT_FALSE(paper.kalman_update.ask_neighbours) << "whatever is around";
  EXPECT_EQ(paper.kalman_update.min_variance_px2, 0);
  EXPECT_TRUE(paper.kalman_update.keep_predicted);
  EXPECT_GT(paper.sad_check.max_difference, 0) << "and what the images do not confirm is dropped";
  EXPECT_FALSE(paper.output_variance.enabled) << "the variance is the filter's";
}

TEST(Options, RangesEndWhereTheyAreSaidTo) {
  struct Ends {
    std::string name;
    std::vector<std::string> allowed, refused;
  };
  const auto with = [](const std::string& name, const std::string& value) {
    PipelineOptions options;
    set_option(options, name, value);
    return options;
  };
  for (const Ends& of : {Ends{"disparities", {"1", "4096"}, {"0", "-1", "4097", "-2147483648"}},
                         {"min_disparity", {"-16384", "16384"}, {"-16385", "16385", "2147483647", "-2147483648"}},
                         {"paths", {"4", "8"}, {"0", "1", "5", "16", "-8"}},
                         {"p1", {"0", "190"}, {"-1", "191"}},
                         {"p2", {"16", "190"}, {"-1", "191"}},
                         {"max_memory_mib", {"0", "2147483647"}, {"-1"}},
                         {"max_speckle_px", {"0", "2147483647"}, {"-1"}}}) {
    for (const std::string& value : of.allowed) EXPECT_NO_THROW(with(of.name, value).validate()) << of.name << value;
    for (const std::string& value : of.refused) {
      expect_refused([&] { with(of.name, value).validate(); }, {"option " + of.name + " is " + value + ": choose "});
    }
  }
}

TEST(Options, AChoiceIsOneThatHasAName) {
  PipelineOptions options;
  options.cost = static_cast<MatchingCost>(4);
  expect_refused([&] { options.validate(); }, {"option cost is ?: choose a named value"});
}

TEST(Options, NumbersAreFiniteAndNotNegative) {
  for (const std::string name :
       {"left_right_px", "search_sigmas", "min_half_width_px", "process_noise_px2", "gate_px"}) {
    for (const std::string bad : {"-0.5", "-1e-30", "nan", "inf", "-inf"}) {
      PipelineOptions options;
      set_option(options, name, bad);
      expect_refused([&] { options.validate(); }, {"option " + name + " is ", ": choose "});
    }
  }
}

// docs/use/options.md has a row for every option, in the order of the list, as the library tells it.
TEST(Options, ThePageSaysWhatTheTableSays) {
  std::ifstream file(EGOSGM_SOURCE_DIR "/docs/use/options.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  const Texts defaults = texts(PipelineOptions());
  std::string table;
  for (const OptionText& text : option_texts()) {
    const std::string unit = *text.unit ? std::string(text.unit) + ": " : "";
    table += std::string("| `") + text.name + "` | " + text.meaning + " | " + unit + text.range + " | " +
             defaults.at(text.name) + " | " + text.when_to_change + " |\n";
  }
  EXPECT_NE(page.find(table), std::string::npos) << "docs/use/options.md must hold:\n" << table;
}

// docs/use/formats.md has a row for every output, in the order of the table.
TEST(Outputs, ThePageSaysWhatTheTableSays) {
  std::ifstream file(EGOSGM_SOURCE_DIR "/docs/use/formats.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  std::string table;
  for (const OutputText& text : output_texts()) {
    table += std::string("| `") + text.name + "` | " + (*text.written ? "`" + std::string(text.written) + "`" : "") +
             " | " + text.values + (*text.unit ? ", " + std::string(text.unit) : "") + " | " + text.meaning + " |\n";
  }
  EXPECT_NE(page.find(table), std::string::npos) << "docs/use/formats.md must hold:\n" << table;
}

TEST(Parameters, EachIsSetByItsNameAlone) {
  const Texts defaults = parameters(MethodOptions());
  EXPECT_EQ(list_parameters({}).size(), defaults.size()) << "a name is there twice";
  for (const auto& [name, text] : defaults) {
    MethodOptions method;
    const std::string other = another_value(text);
    set_parameter(method, name, other);
    Texts expected = defaults;
    expected[name] = other;
    EXPECT_EQ(parameters(method), expected) << name;
  }
  MethodOptions method;
  expect_refused([&] { set_parameter(method, "banded_sgm.p9", "1"); }, {"no constant", "banded_sgm.p9"});
}

// What a test or a bench chooses reaches the pipeline, whatever the public options can say.
TEST(Parameters, SurviveTheWayThroughThePublicOptions) {
  for (const MethodOptions& preset : {MethodOptions(), MethodOptions(PipelineOptions::paper())}) {
    EXPECT_EQ(parameters(PipelineOptions(preset)), parameters(preset));
    for (const auto& [name, text] : parameters(preset)) {
      MethodOptions method = preset;
      set_parameter(method, name, another_value(text));
      EXPECT_EQ(parameters(PipelineOptions(method)), parameters(method)) << name;
    }
  }
  EXPECT_TRUE(PipelineOptions(MethodOptions()).constants.empty()) << "defaults need no constants";
}

TEST(Parameters, AreSetAsConstantsByName) {
  PipelineOptions options;
  set_option(options, "constants.coarse_match.p1", "7");
  set_option(options, "constants.coarse_match.p1", "8");
  set_option(options, "constants.search", "full");
  EXPECT_EQ(texts(options)["constants.coarse_match.p1"], "8");
  EXPECT_EQ(options.constants.size(), 2u);
  const MethodOptions method = options;
  EXPECT_EQ(method.coarse_match.p1, 8);
  EXPECT_EQ(method.search, SearchMode::kFull);
  expect_refused([&] { set_option(options, "constants.coarse_match.p9", "1"); }, {"no constant", "coarse_match.p9"});
  expect_refused([&] { set_option(options, "constants.coarse_match.p1", "x"); }, {"a whole number"});
}

TEST(Parameters, RangesEndWhereTheyAreSaidTo) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> refused{
      {"search_band.neighbour_min_count", {"0", "-1"}},
      {"vertical_alignment.gain", {"1.0001"}},
      {"banded_sgm.p2_at_edges", {"-1", "191"}},
      {"banded_sgm.p2_slope", {"-1", "256"}},
      {"banded_sgm.s_max", {"0", "32768"}},
      {"banded_sgm.variance_floor_px2", {"0"}},
      {"coarse_match.p2", {"-1", "191"}},
      {"output_variance.scale", {"-1", "nan"}}};
  for (const auto& [name, values] : refused) {
    for (const std::string& value : values) {
      PipelineOptions options;
      options.constants = {{name, value}};
      expect_refused([&, name = name] { options.validate(); }, {"option " + name + " is ", ": choose "});
    }
  }
}

}  // namespace
}  // namespace egosgm
