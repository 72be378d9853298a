// SPDX-License-Identifier: Apache-2.0
#include "host/method/plan.h"

#include <gtest/gtest.h>

#include <sstream>
#include <string>

namespace egosgm {
namespace {

std::string text_of(Views views) {
  const std::string left = views.row_step == 1 ? "left" : "left/2";
  if (views.count == 1) return left;
  return left + (views.row_step == 1 ? " right" : " right/2");
}

/// What is decided, in a row.
std::string row(const MethodOptions& options, std::optional<Unpredicted> why_no_belief, bool knows_offset,
                bool has_motion) {
  const Plan plan =
      plan_of(options, why_no_belief, knows_offset, has_motion ? std::optional(Motion{}) : std::nullopt, {});
  EXPECT_EQ(plan.motion.has_value(), plan.predicts());
  std::ostringstream text;
  text << (plan.predicts() ? "-" : to_string(plan.why_not)) << " | "
       << (plan.search == Search::kBands ? "bands" : "everything") << " | tracks " << text_of(plan.tracked)
       << " | matches " << text_of(plan.matched) << " x" << plan.matches << (plan.has_coarse_match ? " | coarse" : "");
  return text.str();
}

struct Case {
  bool temporal;
  SearchMode search;
  bool track_right;
  std::optional<Unpredicted> why_no_belief;
  bool has_motion;
  const char* plan;
};

constexpr SearchMode kBand = SearchMode::kBand, kFull = SearchMode::kFull;
constexpr Unpredicted kFirstFrame = Unpredicted::kFirstFrame, kReset = Unpredicted::kReset;

// All that decides, in all combinations; what a frame without `temporal` has from before does not matter.
constexpr Case kCases[] = {
    {true, kBand, false, {}, true, "- | bands | tracks left/2 | matches left/2 x1 | coarse"},
    {true, kBand, false, {}, false, "no motion | everything | tracks left | matches left right x1 | coarse"},
    {true, kBand, false, kFirstFrame, true, "first frame | everything | tracks left | matches left right x1 | coarse"},
    {true, kBand, false, kFirstFrame, false, "first frame | everything | tracks left | matches left right x1 | coarse"},
    {true, kBand, false, kReset, true, "reset | everything | tracks left | matches left right x1 | coarse"},
    {true, kBand, false, kReset, false, "reset | everything | tracks left | matches left right x1 | coarse"},
    {true, kBand, true, {}, true, "- | bands | tracks left/2 right/2 | matches left/2 right/2 x1 | coarse"},
    {true, kBand, true, {}, false, "no motion | everything | tracks left right | matches left right x1 | coarse"},
    {true, kBand, true, kFirstFrame, true,
     "first frame | everything | tracks left right | matches left right x1 | coarse"},
    {true, kBand, true, kFirstFrame, false,
     "first frame | everything | tracks left right | matches left right x1 | coarse"},
    {true, kBand, true, kReset, true, "reset | everything | tracks left right | matches left right x1 | coarse"},
    {true, kBand, true, kReset, false, "reset | everything | tracks left right | matches left right x1 | coarse"},
    {true, kFull, false, {}, true, "- | everything | tracks left | matches left x1"},
    {true, kFull, false, {}, false, "no motion | everything | tracks left | matches left right x1"},
    {true, kFull, false, kFirstFrame, true, "first frame | everything | tracks left | matches left right x1"},
    {true, kFull, false, kReset, true, "reset | everything | tracks left | matches left right x1"},
    {true, kFull, true, {}, true, "- | everything | tracks left right | matches left right x1"},
    {true, kFull, true, {}, false, "no motion | everything | tracks left right | matches left right x1"},
    {false, kBand, false, {}, true, "not temporal | everything | tracks left | matches left right x1 | coarse"},
    {false, kBand, true, kFirstFrame, false,
     "not temporal | everything | tracks left right | matches left right x1 | coarse"},
    {false, kFull, false, kReset, true, "not temporal | everything | tracks left | matches left right x1"},
};

TEST(Plan, DecidesEveryCase) {
  for (const Case& c : kCases) {
    MethodOptions options;
    options.temporal = c.temporal;
    options.search = c.search;
    options.track_right = c.track_right;
    const std::string actual = row(options, c.why_no_belief, /*knows_offset=*/true, c.has_motion);
    EXPECT_EQ(actual, c.plan) << (c.temporal ? "temporal, " : "alone, ") << (c.search == kBand ? "band, " : "full, ")
                              << (c.track_right ? "both views, " : "left view, ") << to_string(c.why_no_belief)
                              << (c.has_motion ? ", with a motion" : ", without a motion");
  }
}

TEST(Plan, KnowsACameraThatStands) {
  const auto sees_again = [](const MethodOptions& options, double moved_m) {
    Motion motion;
    motion.current_from_previous.translation().x() = moved_m;
    return plan_of(options, {}, true, motion, {}).sees_again;
  };
  MethodOptions options;
  EXPECT_TRUE(sees_again(options, 0));
  EXPECT_TRUE(sees_again(options, 1e-7)) << "poses are rounded";
  EXPECT_FALSE(sees_again(options, 1e-4));
  EXPECT_FALSE(plan_of(options, {}, true, {}, {}).sees_again) << "nobody knows";
  options.coarse_match.enabled = false;
  EXPECT_FALSE(sees_again(options, 0)) << "a pixel could not begin any more";
}

TEST(Plan, MatchesTwiceWhereTheFirstMatchGivesTheVerticalOffset) {
  MethodOptions options;
  EXPECT_EQ(plan_of(options, kFirstFrame, false, {}, {}).matches, 2);
  EXPECT_EQ(plan_of(options, kFirstFrame, true, {}, {}).matches, 1);
  options.vertical_alignment.enabled = false;
  EXPECT_EQ(plan_of(options, kFirstFrame, false, {}, {}).matches, 1);
}

TEST(Plan, HasACoarseMatchOnlyWhereItIsOn) {
  MethodOptions options;
  options.coarse_match.enabled = false;
  EXPECT_EQ(row(options, {}, true, true), "- | bands | tracks left/2 right/2 | matches left/2 right/2 x1");
}

TEST(Plan, MakesOnlyWhatIsWanted) {
  const MethodOptions options;
  const Wanted wanted = plan_of(options, {}, true, {}, {Output::kRightVariance, Output::kDynamic}).wanted;
  EXPECT_TRUE(wanted.has(Output::kRightVariance) && wanted.has(Output::kDynamic) && wanted.has_right());
  EXPECT_FALSE(wanted.has(Output::kVariance) || wanted.has(Output::kReason) || wanted.has(Output::kDisparity));
  EXPECT_TRUE(plan_of(options, {}, true, {}, {}).wanted.has_right()) << "where nothing is said";
}

}  // namespace
}  // namespace egosgm
