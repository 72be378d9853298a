// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/row_interpolation.h"

#include <cmath>

namespace egosgm::reference {

testing::HostMaps row_interpolation(shared::ImageSize size, int right_row_step, const testing::HostMaps& in) {
  testing::HostMaps maps = in;
  const auto fill = [&](int x, int y) {
    const int above = y - y % right_row_step, next = above + right_row_step;
    const auto at = [&](int row) { return static_cast<std::size_t>(size.height + row) * size.width + x; };
    const std::size_t here = at(y), first = at(above), second = at(next < size.height ? next : above);
    if (std::abs(maps.disparity[first] - maps.disparity[second]) <= 1) {
      maps.disparity[here] = (maps.disparity[first] + maps.disparity[second]) / 2;
      maps.variance[here] = (maps.variance[first] + maps.variance[second]) / 2;
    } else {
      const std::size_t surer = maps.variance[second] < maps.variance[first] ? second : first;
      maps.disparity[here] = maps.disparity[surer];
      maps.variance[here] = maps.variance[surer];
    }
    if (maps.disparity[first] == EGOSGM_INVALID_DISPARITY || maps.disparity[second] == EGOSGM_INVALID_DISPARITY) {
      maps.disparity[here] = EGOSGM_INVALID_DISPARITY;
    }
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width && y % right_row_step != 0; ++x) fill(x, y);
  }
  return maps;
}

}  // namespace egosgm::reference
