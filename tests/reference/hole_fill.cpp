// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/hole_fill.h"

#include <algorithm>
#include <cmath>

#include "tests/reference/present_rows.h"

namespace egosgm::reference {
namespace {

// Fills pixel i from its neighbours i - step and i + step.
void fill(const testing::HostMaps& in, std::size_t i, std::size_t step, float max_difference_px,
          testing::HostMaps& out) {
  if (in.hidden[i - step] && in.hidden[i + step]) {
    out.disparity[i] = EGOSGM_INVALID_DISPARITY;
    out.variance[i] = 0;
    out.hidden[i] = 1;
    return;
  }
  const float before = in.disparity[i - step], after = in.disparity[i + step];
  if (in.disparity[i] != EGOSGM_INVALID_DISPARITY) return;
  if (before == EGOSGM_INVALID_DISPARITY || after == EGOSGM_INVALID_DISPARITY) return;
  if (!(std::abs(before - after) < max_difference_px)) return;
  out.disparity[i] = 0.5f * (before + after);
  out.variance[i] = std::max(in.variance[i - step], in.variance[i + step]);
  out.hidden[i] = 0;
}

testing::HostMaps fill_holes(shared::ImageSize size, float max_difference_px, const testing::HostMaps& in) {
  const std::size_t width = size.width, height = size.height;
  testing::HostMaps rows_filled = in;
  for (std::size_t i = 0; i < in.disparity.size(); ++i) {
    const std::size_t x = i % width;
    if (x >= 1 && x + 1 < width) fill(in, i, 1, max_difference_px, rows_filled);
  }
  testing::HostMaps out = rows_filled;
  for (std::size_t i = 0; i < in.disparity.size(); ++i) {
    const std::size_t y = i / width % height;
    if (y >= 1 && y + 1 < height) fill(rows_filled, i, width, max_difference_px, out);
  }
  return out;
}

}  // namespace

testing::HostMaps hole_fill(shared::ImageSize size, float max_difference_px, const testing::HostMaps& in,
                            cl_int row_step) {
  return of_present_rows(size, row_step, in, [&](shared::ImageSize of, const testing::HostMaps& maps) {
    return fill_holes(of, max_difference_px, maps);
  });
}

}  // namespace egosgm::reference
