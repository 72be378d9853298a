// SPDX-License-Identifier: Apache-2.0
#include "host/match/census.h"

#include <algorithm>

namespace egosgm {
namespace {

struct Comparisons {
  int kind, radius_x, radius_y;
};

Comparisons comparisons(MatchingCost cost) {
  switch (cost) {
    case MatchingCost::kSad3x3:
      return {0, 0, 0};
    case MatchingCost::kCensus5x5:
      return {1, 2, 2};
    case MatchingCost::kCensus9x7:
      return {1, 4, 3};
    case MatchingCost::kLearned7x7:
      return {2, 4, 4};  // the window, and a pixel around it for sums of 3x3
  }
  return {};
}

ocl::Program& build(ocl::Context& context, PixelType type, MatchingCost cost, int pixels, int words) {
  context.enter("Census");
  const Comparisons chosen = comparisons(cost);
  return context.program("census.cl", ocl::Defines()
                                          .set("PIXEL_BYTES", type == PixelType::kU8 ? 1 : 2)
                                          .set("CODE_BYTES", 4 * words)
                                          .set("PIXELS", pixels)
                                          .set("COMPARISONS", chosen.kind)
                                          .set("RADIUS_X", chosen.radius_x)
                                          .set("RADIUS_Y", chosen.radius_y));
}

}  // namespace

Census::Census(ocl::Context& context, shared::ImageSize size, PixelType type, MatchingCost cost, int padding,
               int pixels, int words)
    : context_(context),
      size_(size),
      padding_(padding),
      pixels_(pixels > 0 ? pixels : ocl::pixels_a_work_item(context)),
      census_(build(context, type, cost, pixels_, std::max(words, Census::words(cost))), "census") {}

void Census::encode(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uint>& codes) {
  context_.enter("Census");
  const ocl::Range range = pixels_ == 1 ? ocl::every_pixel(context_, {size_.width + 2 * padding_, size_.height})
                                        : ocl::every_row(context_, size_);
  census_(context_, range, size_, padding_, images, codes);
}

}  // namespace egosgm
