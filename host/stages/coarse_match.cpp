// SPDX-License-Identifier: Apache-2.0
#include "host/stages/coarse_match.h"

#include <algorithm>

namespace egosgm {
namespace {

int floor_div(int a, int b) { return a / b - (a % b < 0); }

}  // namespace

shared::DisparityRange CoarseMatch::coarse_range(shared::DisparityRange range) {
  const int first = floor_div(range.min, EGOSGM_COARSE);
  const int last = floor_div(range.min + range.count - 1, EGOSGM_COARSE);
  return {first, last - first + 1};
}

BandedSgmOptions CoarseMatch::matcher(const MethodOptions& options) {
  BandedSgmOptions coarse = options.banded_sgm;
  coarse.cost = MatchingCost::kCensus5x5;
  coarse.p1 = options.coarse_match.p1;
  coarse.p2 = options.coarse_match.p2;
  coarse.p2_at_edges = options.coarse_match.p2_at_edges;
  return coarse;
}

Shrink::Shrink(ocl::Context& context, shared::ImageSize size, PixelType type)
    : stage_(context, "CoarseMatch", "coarse_match.cl", size, 0, pixel_define(type)), shrink_(stage_, "shrink") {}

void Shrink::shrink(const FrameImages& images, FrameImages& coarse) {
  const shared::ImageSize size = shared::coarse_size(stage_.size());
  const int at_once = stage_.pixels() == 1 ? 1 : EGOSGM_COARSE;
  const shared::ImageSize work_items{(size.width + at_once - 1) / at_once, size.height};
  stage_.launch(shrink_, ocl::every_pixel(stage_.enter(), work_items), stage_.size(), images.pixels, coarse.pixels);
}

BandedSgm::Tile CoarseMatch::tile(const ocl::Context& context, const MethodOptions& options, BandedSgm::Tile tile) {
  const BandedSgmOptions& full = options.banded_sgm;
  if (full.cost == MatchingCost::kSad3x3 || BandedSgm::follows_paths(context, full.scheduling)) return tile;
  tile.max_chunks = SearchBand::max_chunks(range_of(options));
  tile.code_words = Census::words(full.cost);
  return tile;
}

CoarseMatch::CoarseMatch(ocl::Context& context, shared::ImageSize size, const MethodOptions& options,
                         BandedSgm::Tile tile)
    : context_((context.enter("CoarseMatch"), context)),
      coarse_(shared::coarse_size(size)),
      range_(coarse_range(range_of(options))),
      max_difference_px_(options.coarse_match.max_difference_px),
      shrink_([=, &context](PixelType type) { return Shrink(context, size, type); }),
      matcher_(context, coarse_, range_, matcher(options), {{}, CoarseMatch::tile(context, options, tile)}),
      consistency_(context, coarse_),
      everything_(context, coarse_, range_),
      images_{ocl::Buffer<cl_uchar>(context, 2 * 2 * pixel_count(coarse_)), PixelType::kU16},
      matched_(context, coarse_) {
  matcher_.prepare(PixelType::kU16);
  matcher_.prepare_reading_off();
}

void CoarseMatch::match(const FrameImages& images, Map& found) {
  const ocl::Context::Within within(context_, "CoarseMatch");
  shrink_[images.type].shrink(images, images_);
  matcher_.reading_off(images_, everything_, matched_, Views::kLeft, /*coded=*/1);
  consistency_.check(matched_.disparity, max_difference_px_, OutsideView::kDrop, found, Views::kBoth);
}

std::uint64_t CoarseMatch::matched_cells() const {
  const std::uint64_t lanes = static_cast<std::uint64_t>(SearchBand::max_chunks(range_)) * EGOSGM_LANES;
  return lanes * coarse_.width * matcher_.banded_sgm().matched_rows();
}

}  // namespace egosgm
