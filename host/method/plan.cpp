// SPDX-License-Identifier: Apache-2.0
#include "host/method/plan.h"

#include "host/stages/evidence.h"

namespace egosgm {
namespace {

// In metres and radians: by less, no pixel moves.
constexpr double kStands = 1e-6;

std::optional<Unpredicted> why_not(const MethodOptions& options, std::optional<Unpredicted> why_no_belief,
                                   const std::optional<Motion>& motion) {
  if (!options.temporal) return Unpredicted::kNotTemporal;
  if (why_no_belief) return why_no_belief;
  if (!motion) return Unpredicted::kNoMotion;
  return {};
}

}  // namespace

bool may_fuse(const MethodOptions& options) { return options.temporal || Evidence::is_of(options); }

Plan plan_of(const MethodOptions& options, std::optional<Unpredicted> why_no_belief, bool knows_offset,
             const std::optional<Motion>& motion, const Wanted& wanted, bool repeats) {
  Plan plan{};
  plan.why_not = why_not(options, why_no_belief, motion);
  plan.fuses = plan.predicts() || Evidence::is_of(options);
  const bool searches_bands = plan.predicts() && options.search == SearchMode::kBand;
  plan.motion = plan.predicts() ? motion : std::nullopt;
  plan.search = searches_bands ? Search::kBands : Search::kEverything;
  plan.tracked = options.track_right ? Views::kBoth : Views::kLeft;
  plan.matched = plan.predicts() ? plan.tracked : Views::kBoth;
  if (searches_bands && Evidence::is_of(options)) {
    plan.matched.row_step = plan.tracked.row_step = options.banded_sgm.row_step;
  }
  plan.matches = options.vertical_alignment.enabled && !knows_offset ? 2 : 1;
  plan.has_coarse_match = plan.fuses && options.search == SearchMode::kBand && options.coarse_match.enabled;
  plan.repeats = repeats;
  plan.sees_again =
      plan.predicts() && plan.has_coarse_match && motion->current_from_previous.matrix().isIdentity(kStands);
  plan.wanted = wanted;
  return plan;
}

}  // namespace egosgm
