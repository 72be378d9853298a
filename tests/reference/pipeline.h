// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/method_options.h"
#include "kernels/shared.h"
#include "tests/reference/evidence.h"
#include "tests/reference/search_band.h"
#include "tests/reference/vertical_alignment.h"
#include "tests/support/random_maps.h"

namespace egosgm::reference {

/// The grey values of both views, of 8 or 16 bits.
struct Images {
  std::vector<int> greys;
  int bits = 8;
};

/// How the disparity spaces of both views move, and whether they stand.
struct ViewMotions {
  shared::DisparityMotion left, right;
  shared::DisparityMotion left_back;  // moves the left view back to the frame before
  bool stand = false;
};

/// A matching pass: of the resampled images, in their bands, and what each stage left of it.
struct Pass {
  std::vector<int> images;
  std::vector<std::uint16_t> greys;  // of 8 bits
  std::vector<float> coarse;         // disparities of both views at a quarter of the resolution
  ViewCodes view_codes, coarse_codes, coarse_alike;
  SearchBands band;
  std::vector<std::uint32_t> codes;     // as kernels/stages/census.cl lays them out
  std::vector<std::uint8_t> penalties;  // as kernels/stages/step_penalties.cl does
  testing::HostMaps matched, smoothed, consistent, measured;
  VerticalOffset offset;  // after this pass; by it the next one is resampled
};

/// What every stage of a frame gave. Maps of stages that did not run are empty.
struct Frame {
  std::string unpredicted;
  int tracked_views = 2;
  int row_step = 1;  // every so many-th row is matched and tracked
  testing::HostMaps warped, without_edges, filled, predicted;
  std::vector<Pass> passes;  // two where nothing was known of the vertical offset
  testing::HostMaps fused, fused_smoothed, fused_consistent, updated;
  testing::HostMaps result;  // on which the next frame rests
  std::vector<std::uint8_t> evidence;
  std::vector<int> block_evidence;  // of both views
  std::vector<float> output;        // disparities that are confirmed
  std::vector<std::uint8_t> dynamic, reasons;
  std::vector<float> output_variance;  // published in place of the result's
  float vertical_offset_px = 0;        // that the last pass was resampled by in the middle
};

/// The references of the stages, in the order of host/frame/pipeline.cpp.
class Pipeline {
 public:
  /// `code_padding`: of the rows of `Pass::codes`.
  Pipeline(shared::ImageSize size, const MethodOptions& options, int code_padding);

  Frame process(const Images& images, const std::optional<ViewMotions>& motions);
  void reset();

 private:
  void predict(const ViewMotions& motions, Frame& frame) const;
  Pass match(const Images& images, const Frame& frame, const VerticalOffset& known) const;
  void update(const Images& images, bool stands, Frame& frame) const;
  bool has_evidence() const;
  int row_step() const;  // of what a frame with a prediction matches
  std::vector<std::uint8_t> explain(const Images& images, const Frame& frame) const;

  shared::ImageSize size_;
  shared::DisparityRange range_;
  MethodOptions options_;
  int code_padding_;
  std::optional<testing::HostMaps> belief_;
  std::vector<int> greys_;  // of the frame that it is of
  int bits_ = 8;
  std::string no_belief_reason_ = "first frame";
  VerticalOffset offset_;
  bool has_offset_ = false;
};

}  // namespace egosgm::reference
