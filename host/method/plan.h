// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "egosgm/motion.h"
#include "egosgm/pipeline.h"
#include "host/frame_outputs.h"
#include "host/stages/maps.h"

namespace egosgm {

/// The disparities that a frame searches.
enum class Search { kBands, kEverything };

/// All that is decided before a frame.
struct Plan {
  std::optional<Unpredicted> why_not;  // there is no prediction
  std::optional<Motion> motion;        // by which it is made
  Search search;
  Views tracked;  // predicted and fused; where bands are searched, in the rows that are matched
  Views matched;  // where it is the left one, the right one is read off its match
  bool fuses;     // a prediction, or nothing, with what is measured
  int matches;    // 2 where the first one gives the vertical offset
  bool has_coarse_match;
  bool repeats;         // the images are those of the frame before
  bool sees_again;      // the camera stands, and bands hide most of the range from a pixel without a prediction
  float grey_step = 1;  // GreyLevels::step of the images
  Wanted wanted;

  bool predicts() const { return !why_not; }
  /// The rows that need codes: those that are matched; reasons ask for those around each pixel.
  cl_int coded_rows() const { return wanted.has(Output::kReason) ? 1 : matched.row_step; }
  /// The views that are tracked, or both where the right one is made of the left one.
  Views with_right() const { return {2, tracked.row_step}; }
  /// The views of which somebody wants maps.
  Views published() const { return {wanted.has_right() ? 2 : 1, tracked.row_step}; }
};

/// Whether frames with these options are ever fused.
bool may_fuse(const MethodOptions& options);

/// `why_no_belief`: why the belief has no maps, if it has none. `knows_offset`: whether it has a vertical offset.
/// `repeats`: whether the images are those of the frame before.
Plan plan_of(const MethodOptions& options, std::optional<Unpredicted> why_no_belief, bool knows_offset,
             const std::optional<Motion>& motion, const Wanted& wanted, bool repeats = false);

}  // namespace egosgm
