// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "egosgm/pipeline.h"
#include "host/ocl/context.h"
#include "host/stages/stripes.h"
#include "kernels/shared.h"

namespace egosgm {

/// The matched parts of a frame, without its bands.
struct MatchedParts {
  int passes;                          // each over all bands
  const std::vector<Stripe>* stripes;  // in which
  std::uint64_t coarse_cells;          // and in each pass, these of CoarseMatch
  cl_int row_step = 1;                 // of the rows of each stripe
};

/// The search of a frame, counted from its bands.
struct MatchedFrame {
  shared::ImageSize size;
  shared::DisparityRange range;
  const std::vector<shared::RowSum>& row_sums;  // of the views that were searched
  const MatchedParts& parts;
  bool has_prediction;
};

/// Reports a frame's prediction and search.
void report_matching(const MatchedFrame& frame, FrameReport& report);

/// Reports a frame's launches, and the times of its stages.
void report_stages(const std::vector<ocl::Context::Finished>& finished, FrameReport& report);
/// Reports each command. REQUIRES: they have ended.
void report_commands(ocl::Context& context, const std::vector<ocl::Command>& commands, FrameReport& report);

}  // namespace egosgm
