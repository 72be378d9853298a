// SPDX-License-Identifier: Apache-2.0
#include "host/coarse_match.h"

#include <algorithm>

namespace egosgm {
namespace {

int floor_div(int a, int b) { return a / b - (a % b < 0); }

const cl::Program& build(ocl::Context& context, PixelType type) {
  context.enter("CoarseMatch");
  return context.program("coarse_match.cl", ocl::Defines()
                                                .set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2)
                                                .set("PIXELS", ocl::pixels_a_work_item(context)));
}

}  // namespace

shared::ImageSize CoarseMatch::coarse_size(shared::ImageSize size) {
  return {(size.width + EGOSGM_COARSE - 1) / EGOSGM_COARSE, (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE};
}

shared::DisparityRange CoarseMatch::coarse_range(shared::DisparityRange range) {
  const int first = floor_div(range.min, EGOSGM_COARSE);
  const int last = floor_div(range.min + range.count - 1, EGOSGM_COARSE);
  return {first, last - first + 1};
}

BandedSgmOptions CoarseMatch::matcher(const PipelineOptions& options) {
  BandedSgmOptions coarse = options.banded_sgm;
  coarse.cost = MatchingCost::kCensus5x5;
  coarse.p1 = options.coarse_match.p1;
  coarse.p2 = options.coarse_match.p2;
  coarse.p2_at_edges = options.coarse_match.p2_at_edges;
  return coarse;
}

CoarseMatch::CoarseMatch(ocl::Context& context, shared::ImageSize size, const PipelineOptions& options)
    : context_((context.enter("CoarseMatch"), context)),
      size_(size),
      coarse_(coarse_size(size)),
      range_(coarse_range({options.min_disparity, options.disparities})),
      matcher_(matcher(options)),
      max_difference_px_(options.coarse_match.max_difference_px),
      shrink_u8_(build(context, PixelType::kU8), "shrink"),
      shrink_u16_(build(context, PixelType::kU16), "shrink"),
      band_(context, coarse_, range_, {}),
      census_(context, coarse_, PixelType::kU16, matcher_.cost, BandedSgm::code_padding(range_)),
      step_penalties_(context, coarse_, PixelType::kU16, matcher_),
      banded_sgm_(context, coarse_, range_, matcher_),
      consistency_(context, coarse_),
      images_(context, 2 * 2 * pixel_count(coarse_)),
      codes_(context, Census::words(matcher_.cost, coarse_, BandedSgm::code_padding(range_))),
      penalties_(context, StepPenalties::count(coarse_)),
      matched_(context, coarse_),
      checked_(context, coarse_) {}

const StereoMaps& CoarseMatch::operator()(const FrameImages& images) {
  const ocl::Context::Within within(context_, "CoarseMatch");
  Shrink& shrink = images.type == PixelType::kU8 ? shrink_u8_ : shrink_u16_;
  const int at_once = ocl::pixels_a_work_item(context_) == 1 ? 1 : EGOSGM_COARSE;
  shrink(context_, ocl::every_pixel(context_, {(coarse_.width + at_once - 1) / at_once, coarse_.height}), size_,
         images.pixels, images_);
  band_.full_range();
  census_(images_, codes_);
  step_penalties_(images_, penalties_);
  banded_sgm_(codes_, penalties_, band_, matched_);
  consistency_(matched_, max_difference_px_, OutsideView::kDrop, checked_);
  return checked_;
}

std::uint64_t CoarseMatch::matched_cells() const {
  const std::uint64_t lanes = static_cast<std::uint64_t>(SearchBand::max_chunks(range_)) * EGOSGM_LANES;
  return 2 * lanes * coarse_.width * banded_sgm_.matched_rows();
}

}  // namespace egosgm
