// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "host/method_options.h"
#include "host/stages/consistency_check.h"
#include "host/stages/matcher.h"

namespace egosgm {

/// Shrinks both images to a quarter: coarse pixels of 16 bits.
class Shrink {
 public:
  Shrink(ocl::Context& context, shared::ImageSize size, PixelType type);

  void shrink(const FrameImages& images, FrameImages& coarse);

 private:
  ocl::Stage stage_;
  ocl::Kernel<const shared::ImageSize, const ocl::Buffer<cl_uchar>, ocl::Buffer<cl_uchar>> shrink_;
};

/// Matches the left view over the full range at a quarter of the resolution, without a prediction, and reads the right
/// view off its path sums: what is far from what the prediction says shows here first. A pixel of the result stands for
/// EGOSGM_COARSE x EGOSGM_COARSE pixels, and its disparity for EGOSGM_COARSE times as many.
class CoarseMatch {
 public:
  /// `tile`: of the match at full resolution, whose program this one takes where it can.
  CoarseMatch(ocl::Context& context, shared::ImageSize size, const MethodOptions& options, BandedSgm::Tile tile = {});

  /// Builds what images of `type` need.
  void prepare(PixelType type) { shrink_.prepare(type); }

  /// Writes the left-right consistent disparities of both views, shared::coarse_size of the images' each. REQUIRES: the
  /// images' type was prepared.
  void match(const FrameImages& images, Map& found);

  /// Cells that a call matches.
  std::uint64_t matched_cells() const;

  /// Both views at a quarter of the resolution, 16 bits: of the last call.
  const ocl::Buffer<cl_uchar>& images() const { return images_.pixels; }

  static shared::DisparityRange coarse_range(shared::DisparityRange range);
  /// The options of BandedSgm at that resolution.
  static BandedSgmOptions matcher(const MethodOptions& options);
  static BandedSgm::Tile tile(const ocl::Context& context, const MethodOptions& options, BandedSgm::Tile tile);

 private:
  ocl::Context& context_;
  const shared::ImageSize coarse_;
  const shared::DisparityRange range_;
  const float max_difference_px_;
  OfEachType<Shrink> shrink_;
  Matcher matcher_;
  ConsistencyCheck consistency_;
  const SearchBands everything_;
  FrameImages images_;
  StereoMaps matched_;
};

}  // namespace egosgm
