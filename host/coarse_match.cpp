// SPDX-License-Identifier: Apache-2.0
#include "host/coarse_match.h"

#include <algorithm>

namespace egosgm {
namespace {

constexpr float kMaxDifferencePx = 1.0f;  // of the left-right check, in coarse pixels

int floor_div(int a, int b) { return a / b - (a % b < 0); }

const cl::Program& build(ocl::Context& context, PixelType type) {
  context.enter("CoarseMatch");
  return context.program("coarse_match.cl", ocl::Defines().set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2));
}

}  // namespace

shared::ImageSize CoarseMatch::coarse_size(shared::ImageSize size) {
  return {(size.width + EGOSGM_COARSE - 1) / EGOSGM_COARSE, (size.height + EGOSGM_COARSE - 1) / EGOSGM_COARSE};
}

shared::DisparityRange CoarseMatch::coarse_range(shared::DisparityRange range) {
  const int first = floor_div(range.min, EGOSGM_COARSE);
  const int last = floor_div(range.min + range.count - 1 + EGOSGM_COARSE - 1, EGOSGM_COARSE);
  return {first, last - first + 1};
}

BandedSgmOptions CoarseMatch::coarse_options(const BandedSgmOptions& options) {
  BandedSgmOptions coarse = options;
  coarse.cost = MatchingCost::kCensus5x5;
  coarse.p1 = 6;
  coarse.p2 = 60;
  coarse.p2_at_edges = 40;
  return coarse;
}

CoarseMatch::CoarseMatch(ocl::Context& context, shared::ImageSize size, shared::DisparityRange range,
                         const BandedSgmOptions& options)
    : context_((context.enter("CoarseMatch"), context)),
      size_(size),
      coarse_(coarse_size(size)),
      shrink_u8_(build(context, PixelType::kU8), "shrink"),
      shrink_u16_(build(context, PixelType::kU16), "shrink"),
      band_(context, coarse_, coarse_range(range), {}),
      census_(context, coarse_, PixelType::kU16, coarse_options(options).cost,
              BandedSgm::code_padding(coarse_range(range))),
      step_penalties_(context, coarse_, PixelType::kU16, coarse_options(options)),
      banded_sgm_(context, coarse_, coarse_range(range), coarse_options(options)),
      consistency_(context, coarse_),
      images_(context, 2 * 2 * pixel_count(coarse_)),
      codes_(context,
             Census::words(coarse_options(options).cost, coarse_, BandedSgm::code_padding(coarse_range(range)))),
      penalties_(context, StepPenalties::plane_count(coarse_)),
      matched_(context, coarse_),
      checked_(context, coarse_) {}

const StereoMaps& CoarseMatch::operator()(const FrameImages& images) {
  context_.enter("CoarseMatch");
  Shrink& shrink = images.type == PixelType::kU8 ? shrink_u8_ : shrink_u16_;
  shrink(context_, ocl::every_pixel(context_, coarse_), size_, images.pixels, images_);
  band_.full_range();
  census_(images_, codes_);
  step_penalties_(images_, penalties_);
  banded_sgm_(codes_, penalties_, band_, matched_);
  consistency_(matched_, kMaxDifferencePx, OutsideView::kDrop, checked_);
  return checked_;
}

}  // namespace egosgm
