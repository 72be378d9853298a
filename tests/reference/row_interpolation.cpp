// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/row_interpolation.h"

#include <cmath>

#include "tests/reference/method.h"

namespace egosgm::reference {

testing::HostMaps row_interpolation(shared::ImageSize size, cl_int row_step, const testing::HostMaps& in) {
  testing::HostMaps maps = in;
  const auto fill = [&](int view, int x, int y) {
    const int step = row_step, above = y - y % step, next = above + step;
    const auto at = [&](int row) {
      return (static_cast<std::size_t>(view) * size.height + row) * size.width + static_cast<std::size_t>(x);
    };
    const std::size_t here = at(y), first = at(above), second = at(next < size.height ? next : above);
    const bool has_first = maps.disparity[first] != EGOSGM_INVALID_DISPARITY;
    const bool has_second = maps.disparity[second] != EGOSGM_INVALID_DISPARITY;
    if (has_first && has_second && std::abs(maps.disparity[first] - maps.disparity[second]) <= kRowsAgreePx) {
      maps.disparity[here] = (maps.disparity[first] + maps.disparity[second]) / 2;
      maps.variance[here] = (maps.variance[first] + maps.variance[second]) / 2;
    } else {
      maps.disparity[here] = has_first == has_second ? EGOSGM_INVALID_DISPARITY
                             : has_first             ? maps.disparity[first]
                                                     : maps.disparity[second];
      maps.variance[here] = has_first == has_second ? 0 : has_first ? maps.variance[first] : maps.variance[second];
    }
  };
  for (const int view : {EGOSGM_LEFT, EGOSGM_RIGHT}) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width && y % row_step != 0; ++x) fill(view, x, y);
    }
  }
  return maps;
}

}  // namespace egosgm::reference
