// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "egosgm/options.h"
#include "kernels/shared.h"

namespace egosgm {

/// What contradicts a static world, of one view: 255 at a pixel with a prediction and a measurement where, of the
/// pixels of its 9x9 window that have both, at least half differ by more than `min_difference_px`, if a third of the
/// window has both; else 0.
std::vector<std::uint8_t> dynamic_map(shared::ImageSize size, const DynamicMapOptions& options,
                                      const std::vector<float>& predicted, const std::vector<float>& measured);

}  // namespace egosgm
