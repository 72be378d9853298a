// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "egosgm/pipeline.h"
#include "host/match/stripes.h"
#include "host/ocl/context.h"
#include "kernels/shared.h"

namespace egosgm {

/// What was matched of a frame, apart from which bands.
struct MatchedParts {
  int passes;                          // each over all bands
  const std::vector<Stripe>* stripes;  // in which
  std::uint64_t coarse_cells;          // and in each pass, these of CoarseMatch
};

/// What a frame's bands say of it.
struct MatchedFrame {
  shared::ImageSize size;
  shared::DisparityRange range;
  const std::vector<shared::RowSum>& row_sums;  // of the views that were searched
  const MatchedParts& parts;
  bool has_prediction;
};

/// What the report tells of what was predicted and matched.
void report_matching(const MatchedFrame& frame, FrameReport& report);

/// What the report tells of a frame's commands: launches and stages.
void report_stages(const std::vector<ocl::Context::Finished>& finished, FrameReport& report);
/// The same: each of them. REQUIRES: they have ended.
void report_commands(ocl::Context& context, const std::vector<ocl::Command>& commands, FrameReport& report);

}  // namespace egosgm
