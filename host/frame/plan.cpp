// SPDX-License-Identifier: Apache-2.0
#include "host/frame/plan.h"

namespace egosgm {
namespace {

Unpredicted unpredicted(const MethodOptions& options, Unpredicted missing, const std::optional<Motion>& motion) {
  if (!options.temporal) return Unpredicted::kNotTemporal;
  if (missing != Unpredicted::kNo) return missing;
  return motion ? Unpredicted::kNo : Unpredicted::kNoMotion;
}

}  // namespace

Plan plan_of(const MethodOptions& options, Unpredicted missing, bool knows_offset, const std::optional<Motion>& motion,
             const Wanted& wanted, bool repeats) {
  Plan plan{};
  plan.unpredicted = unpredicted(options, missing, motion);
  const bool searches_bands = plan.predicts() && options.search == SearchMode::kBand;
  plan.motion = plan.predicts() ? motion : std::nullopt;
  plan.search = searches_bands ? Search::kBands : Search::kEverything;
  plan.tracked = options.track_right ? Views::kBoth : Views::kLeft;
  plan.matched = plan.predicts() ? plan.tracked : Views::kBoth;
  plan.matches = options.vertical_alignment.enabled && !knows_offset ? 2 : 1;
  plan.has_coarse_match = searches_bands && options.coarse_match.enabled;
  plan.repeats = repeats;
  plan.wanted = wanted;
  if (!options.output_variance.enabled) plan.wanted.variance.reset();
  return plan;
}

}  // namespace egosgm
