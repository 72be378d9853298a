// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/edge_rejection.h"

#include <cmath>

#include "tests/reference/present_rows.h"

namespace egosgm::reference {
namespace {

struct Step {
  int x, y;
};

testing::HostMaps reject_edges(shared::ImageSize size, float max_jump_px, const testing::HostMaps& in) {
  testing::HostMaps out = in;
  const std::size_t pixels = static_cast<std::size_t>(size.width) * size.height;
  for (std::size_t i = 0; i < 2 * pixels; ++i) {
    if (in.disparity[i] == EGOSGM_INVALID_DISPARITY) continue;
    const int x = static_cast<int>(i % size.width), y = static_cast<int>(i % pixels / size.width);
    for (const Step step : {Step{-1, 0}, Step{1, 0}, Step{0, -1}, Step{0, 1}}) {
      for (int distance = 1; distance <= 2; ++distance) {
        const int nx = x + distance * step.x, ny = y + distance * step.y;
        if (nx < 0 || nx >= size.width || ny < 0 || ny >= size.height) break;
        const float neighbour = in.disparity[i / pixels * pixels + static_cast<std::size_t>(ny) * size.width + nx];
        if (neighbour == EGOSGM_INVALID_DISPARITY) continue;
        if (std::abs(neighbour - in.disparity[i]) > max_jump_px) out.disparity[i] = EGOSGM_INVALID_DISPARITY;
        break;
      }
    }
  }
  return out;
}

}  // namespace

testing::HostMaps edge_rejection(shared::ImageSize size, float max_jump_px, const testing::HostMaps& in,
                                 cl_int row_step) {
  return of_present_rows(size, row_step, in, [&](shared::ImageSize of, const testing::HostMaps& maps) {
    return reject_edges(of, max_jump_px, maps);
  });
}

}  // namespace egosgm::reference
