// SPDX-License-Identifier: Apache-2.0
#include "host/stages/census.h"

#include <algorithm>

namespace egosgm {
namespace {

/// Half of the window that is compared with a pixel; 0: its grey value is taken.
struct Radius {
  int x, y;
};

Radius radius(MatchingCost cost) {
  switch (cost) {
    case MatchingCost::kSad3x3:
      return {0, 0};
    case MatchingCost::kCensus5x5:
      return {2, 2};
    case MatchingCost::kCensus9x7:
      return {4, 3};
  }
  return {};
}

ocl::Defines defines(PixelType type, MatchingCost cost, int words) {
  const auto [radius_x, radius_y] = radius(cost);
  return pixel_define(type)
      .set("CODE_BYTES", 4 * std::max(words, Census::words(cost)))
      .set("RADIUS_X", radius_x)
      .set("RADIUS_Y", radius_y);
}

}  // namespace

Census::Census(ocl::Context& context, shared::ImageSize size, PixelType type, MatchingCost cost, int padding,
               int pixels, int words)
    : stage_(context, "Census", "census.cl", size, pixels, defines(type, cost, words)),
      padding_(padding),
      census_(stage_, "census") {}

void Census::encode(const ocl::Buffer<cl_uchar>& images, ocl::Buffer<cl_uint>& codes, cl_int row_step, bool alike) {
  const shared::ImageSize size = stage_.size();
  ocl::Context& context = stage_.enter();
  const ocl::Range range = stage_.pixels() == 1 ? ocl::every_pixel(context, {size.width + 2 * padding_, size.height})
                                                : ocl::every_row(context, size);
  census_(context, range, size, row_step, padding_, alike, images, codes);
}

}  // namespace egosgm
